"""Finding out what a device takes: what is asked, and what its answers mean. Knows no device and no bus."""

"""Every bit of a frame explained, service by service."""

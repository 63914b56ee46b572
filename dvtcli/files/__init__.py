"""File formats, a module or a folder each; none uses a device, a bus or a terminal."""

"""One whole device: back it up, compare it with a file, plan what a file of a device asks for."""

"""Read, save and compare a whole device: all objects of its dictionary."""

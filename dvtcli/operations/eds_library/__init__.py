"""The library of device files: add, list, find the file of a node."""

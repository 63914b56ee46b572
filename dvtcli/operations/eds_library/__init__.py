"""The library of device files: filled, listed, and asked which file describes a node."""

"""Probe the write behaviour of a device, and roll back."""

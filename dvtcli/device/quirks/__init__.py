"""Deviations of devices from the standard, one per file; a profile names its deviations."""

"""Devices that do it differently, each behaviour in one file; a profile names those that count."""

"""Formats of recordings, a module each, found by being in this folder."""

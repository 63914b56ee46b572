"""Interrupted changes and stores: which there are, gone on with, put back, or closed."""

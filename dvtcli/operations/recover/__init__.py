"""Interrupted changes and stores: list, complete, recover, close."""

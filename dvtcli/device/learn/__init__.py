"""Asking a device what it takes, and putting it back."""

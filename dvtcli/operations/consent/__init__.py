"""Consent before dangerous acts, and detection of other masters."""

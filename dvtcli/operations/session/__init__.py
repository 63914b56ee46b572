"""The session: what is open, what was done in it, and a bus that goes and comes back."""

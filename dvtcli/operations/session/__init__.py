"""A session: what is open, what was done, and a bus that is lost and reopened."""

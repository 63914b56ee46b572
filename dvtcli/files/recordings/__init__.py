"""Formats of recordings, listed by `formats`; pasted text is recognised by its content."""

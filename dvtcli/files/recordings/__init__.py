"""Formats of recordings, listed by `recording_formats`; pasted text is recognised by its content."""

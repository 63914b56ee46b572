"""Single frames: explained, remembered, sent, and played from a recording."""

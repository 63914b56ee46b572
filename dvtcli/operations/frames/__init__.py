"""Frames: explained, remembered, sent, decoded; recordings made, checked, decoded and played again."""

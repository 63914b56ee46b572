"""Recordings of a bus: made, checked, decoded, replayed."""

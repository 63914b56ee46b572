"""Probing a device's limits: the questions, and the meaning of the answers."""

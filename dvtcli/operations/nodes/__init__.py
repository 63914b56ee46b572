"""Nodes as they stand on the bus: found, named, commanded, logged in to, given a program."""

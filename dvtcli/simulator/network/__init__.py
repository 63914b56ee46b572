"""Simulated nodes among others: on a bus, behind a socket, in virtual time, as a twin."""

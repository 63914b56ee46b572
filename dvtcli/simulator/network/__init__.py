"""Simulated nodes on a network: on a bus, behind a socket, in virtual time, as a twin."""

"""SYNC: producers, consumers, and sending."""

"""Change one device as a transaction (complete, rolled back, or reported as incomplete): lock, journal, backup."""

"""Configuration of a whole network: several nodes as a unit."""

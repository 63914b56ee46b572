"""Open the bus of the options and its nodes: real, simulated, or twins for a dry run."""

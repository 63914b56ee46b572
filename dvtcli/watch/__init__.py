"""What is on the bus right now, and what a recording holds: frames named, decoded, counted and drawn."""

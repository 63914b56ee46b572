"""Several nodes as one: what a whole network should hold."""

"""The prompt's parts: reading a line at a terminal, completing it, and what is heard of the nodes meanwhile."""

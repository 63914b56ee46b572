"""`store` and `restore` of a node and of all nodes of a network."""

"""Objects of a node: search, read, watch, write, transfer to and from files."""

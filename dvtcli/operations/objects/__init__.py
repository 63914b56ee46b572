"""Objects of a node: searched, read, watched, written, and as files."""

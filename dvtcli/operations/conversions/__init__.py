"""`eds convert` and its output formats."""

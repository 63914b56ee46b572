"""A whole device: everything that its object dictionary holds, read, kept in a file, and compared."""

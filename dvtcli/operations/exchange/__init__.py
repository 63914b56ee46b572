"""Import and export files of other tools."""

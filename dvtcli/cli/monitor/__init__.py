"""The monitor's screen: rows, graphs and keys. Does not know where frames come from."""

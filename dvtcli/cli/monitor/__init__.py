"""The monitor's screen: rows, graphs and keys."""

"""Networks: described by files, read from the bus, checked and configured."""

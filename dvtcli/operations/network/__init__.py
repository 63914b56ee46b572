"""Networks: described by files, as they are on the bus, checked, and brought from the one to the other."""

"""Objects and values as users write them, for a node. Asks no device."""

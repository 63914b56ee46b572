"""What people write of objects and their values, and what it means on a node. Asks no device."""

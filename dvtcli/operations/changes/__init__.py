"""Make verified changes on a node or on several nodes together, and undo them."""

"""Read the wanted state from a network file and resolve it for the nodes present. Writes nothing."""

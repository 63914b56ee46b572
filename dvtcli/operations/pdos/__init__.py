"""The PDOs of a node: list, switch, edit as text, check frames; and virtual PDOs inside it."""

"""The PDOs of a node: listed, switched, written as text, seen as frames; and the virtual ones inside it."""

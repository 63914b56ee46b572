"""A network drawn: as a page (HTML), a drawing (SVG) and a graph (Graphviz)."""

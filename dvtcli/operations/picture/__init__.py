"""A picture of a network: gathered as one plain value, and written as a page, a drawing or a graph."""

"""A picture of a network: collected as a plain value, written as page, drawing or graph."""

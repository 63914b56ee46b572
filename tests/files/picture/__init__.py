"""Networks drawn: pages, drawings, graphs."""

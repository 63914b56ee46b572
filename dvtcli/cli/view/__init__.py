"""Convert results to text; no other package knows their appearance."""

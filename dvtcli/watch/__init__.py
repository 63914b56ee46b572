"""Live bus traffic and recordings: name, decode, count and draw frames."""

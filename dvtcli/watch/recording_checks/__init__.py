"""Find problems in recorded frames: rules, each in one pass over the frames."""

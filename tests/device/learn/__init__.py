"""Learning a device: what is learnt answers as the original does, and nothing is left behind."""

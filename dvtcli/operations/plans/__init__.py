"""Plan what brings a network to a wanted state, judge the plan and carry it out."""

"""From what the user said to an open bus and its nodes, real, simulated or tried out on twins."""

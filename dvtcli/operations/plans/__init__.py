"""From what is wanted of a network to a judged plan, and carrying it out."""

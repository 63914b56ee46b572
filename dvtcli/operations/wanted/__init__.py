"""What a network file wants: read, and put in the terms of the nodes that are there. Writes nothing."""

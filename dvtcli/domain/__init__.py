"""CANopen vocabulary and decisions: pure, standard library only, without buses, files or terminals."""

"""A change of one device: carried out as a whole, put back, or told what is left; lock, journal, backup."""

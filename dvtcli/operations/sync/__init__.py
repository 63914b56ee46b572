"""SYNC: who sends it, who listens for it, and sending it from here."""

"""What `help` says, and the topics as texts."""

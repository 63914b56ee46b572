"""What the user has said, in options and settings files, and how he is told and asked."""

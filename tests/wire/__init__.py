"""What each job sends: golden files of frames, so that code can be moved without a frame that changes."""

"""What every bit of a frame says, service by service."""

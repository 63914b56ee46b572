"""What needs a yes before it is done, and who else commands the nodes."""

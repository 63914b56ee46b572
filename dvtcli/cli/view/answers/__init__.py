"""What commands answer, as lines of text: a file for each kind of result."""

"""The use cases: an operation for each task of a user, without command words and screens."""

"""The use cases: each one thing that a user can want, without words and screens."""

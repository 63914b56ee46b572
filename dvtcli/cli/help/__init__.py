"""The output of `help`, and its topics as texts."""

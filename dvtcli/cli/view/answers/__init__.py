"""Answers of commands as lines of text: a file per kind of result."""

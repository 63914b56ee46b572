"""Lint EDS and DCF files: oddities of the text and, by `domain.lint`, of the described device."""

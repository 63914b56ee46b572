"""The linter of EDS and DCF files: what is odd in the text, and, by `domain.lint`, in the device it describes."""

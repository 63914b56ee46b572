"""Output formats of `export`, one module each."""

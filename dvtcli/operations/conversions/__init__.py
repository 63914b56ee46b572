"""Output formats of `eds convert`, one module each."""

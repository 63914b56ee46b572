"""The rules of `check` for a whole network; each file declares its rules above their check functions."""

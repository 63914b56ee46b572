"""The prompt: reading and completing lines at a terminal, and messages from nodes meanwhile."""

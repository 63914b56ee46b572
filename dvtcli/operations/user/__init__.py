"""The user: options, settings files, messages and questions."""

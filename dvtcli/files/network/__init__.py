"""A whole network in one YAML file: read, and written."""

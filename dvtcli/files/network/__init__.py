"""Read and write a whole network as a YAML file."""

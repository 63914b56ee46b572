"""LSS: nodes found, given a node-ID and a bit rate, and let keep both."""

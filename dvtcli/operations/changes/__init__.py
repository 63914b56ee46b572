"""From a request to a verified change, on one node or on several together, and taking it back."""

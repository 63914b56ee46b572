"""Values into text: the only place that knows what results look like. Knows no session and no bus."""

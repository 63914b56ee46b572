"""Scripts: parsed whole, run line by line, kept or taken back, rehearsed on twins, and told of in a report."""

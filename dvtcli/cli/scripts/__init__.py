"""Scripts: parsed whole, run line by line, kept or rolled back, rehearsed on twins, and reported."""

"""Files of values over time: CSV, Parquet, JSON lines."""

"""EDS and DCF files (CiA 306)."""

"""XDD and XDC files (CiA 311)."""

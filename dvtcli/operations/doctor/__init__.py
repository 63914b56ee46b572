"""The checks behind `doctor`."""

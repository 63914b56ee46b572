"""Whole devices: back up, compare, plan, export, learn; the library of EDS files and profiles."""

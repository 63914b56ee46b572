"""What is known of kinds of devices: EDS files, profiles, habits, and what was learnt."""

"""Knowledge about kinds of devices: EDS files, profiles, habits, learnt families."""

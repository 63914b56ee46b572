"""The DVT's own words and its Tcl scripts, on the same functions as the commands that are meant for each."""

"""The DVT's own words and Tcl scripts, built on the functions of the equivalent commands."""

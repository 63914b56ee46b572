"""Pages as a browser shows them, where there is one."""

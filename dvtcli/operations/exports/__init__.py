"""Files that `export` writes, a format each, which is found by being here."""

"""Files that `eds convert` writes, a format each, which is found by being here."""

"""The formats that recordings of frames have, a file each, which is found by being here."""

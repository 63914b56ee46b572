"""One file per file format; each knows its format and no device, bus or terminal."""

"""The output formats of `export`; what they write is made in `exchange/` and `whole_device/`."""

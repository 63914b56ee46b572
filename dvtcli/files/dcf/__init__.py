"""DCF files (CiA 306): a device's EDS with what one device of its kind holds."""

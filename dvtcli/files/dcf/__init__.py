"""DCF files (CiA 306): a device's EDS with the values of one device."""

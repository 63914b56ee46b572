"""Read, change and store one device over SDO and NMT. No other package changes a device's settings."""

"""Read, change and store one device over SDO and NMT. No other package writes to devices."""

"""SDO over a bus: the strict client, its channel and what stands between both."""

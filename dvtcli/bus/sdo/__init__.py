"""SDO over a bus: the strict client, its channel and the link between both."""

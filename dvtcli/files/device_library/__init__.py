"""The user's own files of devices, found again by a node's identity (0x1018). Reads and matches; writes nothing."""

"""Store and restore of one device: signatures, changes not yet stored, and the proof of a store by a reset."""

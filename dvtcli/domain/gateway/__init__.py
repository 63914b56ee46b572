"""The ASCII lines of a CANopen gateway (CiA 309-3): what clients ask, and what they are answered."""

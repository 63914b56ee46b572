"""The ASCII lines of a CANopen gateway (CiA 309-3): requests and answers."""

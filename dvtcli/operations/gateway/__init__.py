"""A CANopen gateway (CiA 309-3): a server, and plans as gateway lines."""

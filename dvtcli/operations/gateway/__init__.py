"""A CANopen gateway of CiA 309-3: its lines served, and plans as lines."""

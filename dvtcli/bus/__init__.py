"""Access to a CANopen network; `opening` opens it."""

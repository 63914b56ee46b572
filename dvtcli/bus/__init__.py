"""Ways to reach a CANopen network; `opening` opens one. Knows no simulation: who opens a bus decides which."""

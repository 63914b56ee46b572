"""NMT states and commands (CiA 301, 7.2.8 and 7.3.2). Does not know how they travel."""

from __future__ import annotations

from enum import IntEnum

#: the node-ID of a node that has none and waits for one (CiA 305)
UNCONFIGURED = 0xFF


class NmtState(IntEnum):
    """A node's state as its heartbeat carries it."""

    INITIALISING = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F

    @property
    def label(self) -> str:
        """The state's name in the standard's spelling."""
        return self.name.replace("_", "-")


class NmtCommand(IntEnum):
    """An NMT command specifier."""

    START = 0x01
    STOP = 0x02
    ENTER_PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82

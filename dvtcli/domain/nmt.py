"""NMT states and commands (CiA 301, 7.2.8 and 7.3.2)."""

from __future__ import annotations

from enum import IntEnum

#: the node-ID of a node that has none and waits for one (CiA 305)
UNCONFIGURED = 0xFF


class NmtState(IntEnum):
    """NMT state in a heartbeat."""

    INITIALISING = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F

    @property
    def label(self) -> str:
        """The state's name in the standard's spelling."""
        return self.name.replace("_", "-")

    @property
    def short(self) -> str:
        """Short form of the state."""
        return _SHORT.get(self, self.label)


class NmtCommand(IntEnum):
    """An NMT command specifier."""

    START = 0x01
    STOP = 0x02
    ENTER_PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82

    @property
    def word(self) -> str:
        """The command as a word of a command line."""
        return _WORDS[self]

    @property
    def is_reset(self) -> bool:
        """Whether the node boots after the command."""
        return self in (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION)

    @property
    def after(self) -> NmtState:
        """State of a node after the command; for a reset, after its boot-up."""
        return _AFTER[self]


_SHORT = {NmtState.INITIALISING: "INIT", NmtState.OPERATIONAL: "OP", NmtState.PRE_OPERATIONAL: "PRE-OP"}
_WORDS = {
    NmtCommand.START: "start",
    NmtCommand.STOP: "stop",
    NmtCommand.ENTER_PRE_OPERATIONAL: "preop",
    NmtCommand.RESET_NODE: "reset-node",
    NmtCommand.RESET_COMMUNICATION: "reset-comm",
}
_AFTER = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
    NmtCommand.RESET_NODE: NmtState.PRE_OPERATIONAL,
    NmtCommand.RESET_COMMUNICATION: NmtState.PRE_OPERATIONAL,
}

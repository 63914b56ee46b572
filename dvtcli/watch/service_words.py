"""Words of NMT, SYNC, TIME, EMCY, heartbeats and SDO command specifiers, for whole frames and for their parts. Pure."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from dvtcli.domain.nmt import NmtCommand, NmtState

SDO_BYTES = 8
#: milliseconds of a day
DAY_MS = 24 * 60 * 60 * 1000
#: first day of TIME (CiA 301, 7.2.6)
_EPOCH = datetime(1984, 1, 1, tzinfo=UTC)
#: the values of SYNC's counter (CiA 301, 7.2.5.3.2)
_COUNTERS = range(1, 241)
_COMMANDS, _STATES = frozenset(NmtCommand), frozenset(NmtState)
#: minimum and maximum number of bytes by kind of service; a shortened EMCY is accepted
_LENGTHS = {
    "nmt": (2, 2, "an NMT command has 2 bytes"),
    "sync": (0, 1, "SYNC has 1 byte at most"),
    "time": (6, 6, "TIME has 6 bytes"),
    "emcy": (2, 8, "EMCY has 8 bytes"),
    "heartbeat": (1, 1, "a heartbeat has 1 byte"),
    "sdo": (SDO_BYTES, SDO_BYTES, "an SDO has 8 bytes"),
    "mpdo": (SDO_BYTES, SDO_BYTES, "a multiplexed PDO has 8 bytes"),
}
#: a client's and a server's command specifiers (CiA 301, 7.2.4.3)
_REQUESTS = (
    "download segment", "initiate download", "initiate upload", "upload segment", "abort transfer", "block upload",
    "block download",
)  # fmt: skip
_ANSWERS = (
    "upload segment", "download segment accepted", "initiate upload", "download accepted", "abort transfer",
    "block download", "block upload",
)  # fmt: skip


def wrong_length(kind: str, length: int) -> str:
    """What is wrong with *length* bytes of a service's frame: `too short: TIME has 6 bytes`; empty if nothing is."""
    least, most, words = _LENGTHS[kind]
    return f"too short: {words}" if length < least else f"too long: {words}" if length > most else ""


def command_word(command: int) -> str | None:
    """An NMT command specifier as the command `nmt` takes it, None if reserved."""
    return NmtCommand(command).word if command in _COMMANDS else None


def addressee(node_id: int) -> str:
    """The nodes to which an NMT command is sent."""
    return "all nodes" if not node_id else f"node {node_id}" if node_id <= 127 else f"reserved node-ID {node_id}"


def wrong_counter(counter: int) -> str:
    """What is wrong with SYNC's *counter*, empty if nothing is."""
    return "" if counter in _COUNTERS else "reserved: SYNC counts from 1 to 240 at most"


def state_word(byte: int) -> str:
    """The NMT state in a heartbeat's *byte*, without its toggle bit."""
    state = byte & 0x7F
    return NmtState(state).label if state in _STATES else f"reserved state 0x{state:02X}"


def time_of_day(milliseconds: int, days: int) -> datetime | None:
    """The time in TIME's *milliseconds* and *days*; None if that is longer than a day."""
    return _EPOCH + timedelta(days=days, milliseconds=milliseconds) if milliseconds < DAY_MS else None


def day(days: int) -> str:
    """The date of TIME's *days*."""
    return (_EPOCH + timedelta(days=days)).strftime("%Y-%m-%d")


def sdo_command(specifier: int, *, request: bool) -> str | None:
    """The command *specifier* (0..7) of an SDO *request*, or of an answer; None if there is none."""
    words = _REQUESTS if request else _ANSWERS
    return words[specifier] if specifier < len(words) else None

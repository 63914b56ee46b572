"""NMT, SYNC, TIME, EMCY and heartbeat frames, bit by bit (CiA 301, 7.2). Does not know who sent them."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta

from dvtcli.domain.emergency_codes import emergency_text, register_words
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.watch.explain.parts import Bytes, FramePart

_DAY_MS = 24 * 60 * 60 * 1000
#: the day from which TIME counts (CiA 301, 7.2.6)
_EPOCH = datetime(1984, 1, 1, tzinfo=UTC)
#: the values of SYNC's counter (CiA 301, 7.2.5.3.2)
_COUNTERS = range(1, 241)


def nmt_parts(data: bytes) -> Iterator[FramePart]:
    """An NMT command, and whom it is for."""
    cut = Bytes(data)
    if data:
        word = NmtCommand(data[0]).word if data[0] in set(NmtCommand) else "reserved"
        whole = "" if len(data) > 1 else "; too short: an NMT command has 2 bytes"
        yield cut.part(0, 8, "command specifier", word + whole)
    if len(data) > 1:
        node = data[1]
        yield cut.part(8, 8, "node-ID", "all nodes" if not node else f"node {node}" if node <= 127 else "reserved")
    yield from cut.rest(2, "one too many: an NMT command has 2 bytes")


def sync_parts(data: bytes) -> Iterator[FramePart]:
    """SYNC: nothing, or its counter."""
    cut = Bytes(data)
    if data:
        said = str(data[0]) if data[0] in _COUNTERS else "reserved: SYNC counts from 1 to 240 at most"
        yield cut.part(0, 8, "counter", said)
    yield from cut.rest(1, "one too many: SYNC has a counter at most")


def time_parts(data: bytes) -> Iterator[FramePart]:
    """TIME: milliseconds since midnight, and days since 1 January 1984."""
    cut = Bytes(data)
    if len(data) < 6:
        yield from cut.rest(0, "too short: TIME has 6 bytes")
        return
    milliseconds, days = cut.raw(0, 28), cut.number(4, 2)
    at = _EPOCH + timedelta(days=days, milliseconds=milliseconds % _DAY_MS)
    clock = at.strftime("%H:%M:%S.") + f"{at.microsecond // 1000:03d}"
    yield cut.part(0, 28, "ms since midnight", clock if milliseconds < _DAY_MS else "more than a day has")
    yield cut.part(28, 4, "reserved")
    yield cut.part(32, 16, "days since 1984-01-01", at.strftime("%Y-%m-%d"))
    yield from cut.rest(6, "one too many: TIME has 6 bytes")


def emergency_parts(data: bytes) -> Iterator[FramePart]:
    """An emergency: its code, the error register, and what the maker adds."""
    cut = Bytes(data)
    if len(data) < 2:
        yield from cut.rest(0, "too short: EMCY has 8 bytes")
        return
    yield cut.part(0, 16, "emergency error code", emergency_text(cut.number(0, 2)))
    if len(data) > 2:
        yield cut.part(16, 8, "error register", ", ".join(register_words(data[2])) or "no error")
    yield from cut.rest(3, "the maker's own")


def heartbeat_parts(data: bytes) -> Iterator[FramePart]:
    """A heartbeat, a boot-up, or the answer of node guarding."""
    cut = Bytes(data)
    if not data:
        return
    state = data[0] & 0x7F
    words = NmtState(state).label if state in set(NmtState) else "reserved"
    yield cut.part(7, 1, "toggle bit of node guarding", "" if data[0] & 0x80 else "0 in a heartbeat")
    yield cut.part(0, 7, "NMT state", "boot-up" if data == b"\0" else words)
    yield from cut.rest(1, "one too many: a heartbeat has 1 byte")

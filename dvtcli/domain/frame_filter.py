"""Frame filters: `181`, `180-1FF`, `180:780`, `node=5`, `tpdo1`, `5:tpdo1`, `sdo`."""

from __future__ import annotations

import re
from collections.abc import Callable

from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import Frame

#: kinds of frames as they are read in words
READ_KINDS = (
    "pdo", "mpdo", "sdo", "sdo-abort", "nmt", "emcy", "heartbeat", "boot-up", "guarding", "sync", "time", "lss",
    "other",
)  # fmt: skip

#: Whether a frame passes, given its service's kind, label, and node-ID if known.
FrameFilter = Callable[[Frame, str, str, int | None], bool]

#: names of services
KINDS = ("nmt", "sync", "time", "emcy", "pdo", "sdo", "lss", "heartbeat", "other")
HOW = f"181, 180-1FF, 180:780 (hex, ID:MASK), node=5, tpdo1, 5:tpdo1, or one of {' '.join(KINDS)}"
_HEX = r"(?:0x)?([0-9a-f]{1,8})"
_RANGE = re.compile(rf"{_HEX}(?:-{_HEX})?")
_MASK = re.compile(rf"{_HEX}:{_HEX}")
_NODE = re.compile(r"node[=:]?(\d{1,3})")
_PDO = re.compile(r"(?:(\d{1,3}):)?([rt]pdo\d{1,3})")
_MOST_STANDARD, _MOST, _MOST_NODE, _SHORT_DIGITS = 0x7FF, 0x1FFF_FFFF, 127, 3


def frame_filter(text: str) -> FrameFilter:
    """The filter for *text*. More than three hex digits are a CAN-ID of 29 bits. Raises ValueError if invalid."""
    word = text.strip().lower()
    if word in KINDS:
        return lambda _frame, kind, _label, _node: kind == word
    if found := _NODE.fullmatch(word):
        node_id = _node_id(found[1])
        return lambda _frame, _kind, _label, node: node == node_id
    if found := _PDO.fullmatch(word):
        node_of_pdo = None if found[1] is None else _node_id(found[1])
        label = Pdo.parse(found[2]).label
        return lambda _frame, kind, of, node: kind == "pdo" and of.rstrip("?") == label and node_of_pdo in (None, node)
    if found := _RANGE.fullmatch(word):
        return _range(found[1], found[2] or found[1])
    if found := _MASK.fullmatch(word):
        can_id, mask = _can_id(found[1]), _can_id(found[2])
        return lambda frame, *_service: frame.can_id & mask == can_id & mask
    raise ValueError(f"{text!r} names no frames: {HOW}")


def _range(first: str, last: str) -> FrameFilter:
    low, high = _can_id(first), _can_id(last)
    if low > high:
        raise ValueError(f"{first}-{last} is empty: the lower CAN-ID comes first")
    extended = high > _MOST_STANDARD or max(len(first), len(last)) > _SHORT_DIGITS
    return lambda frame, *_service: frame.extended is extended and low <= frame.can_id <= high


def _can_id(digits: str) -> int:
    can_id = int(digits, 16)
    if can_id > _MOST:
        raise ValueError(f"0x{can_id:X} is no CAN-ID: it has 29 bits at most")
    return can_id


def _node_id(digits: str) -> int:
    if not 1 <= int(digits) <= _MOST_NODE:
        raise ValueError(f"node-ID {digits} is outside 1…127")
    return int(digits)

"""Frames as typed (`185#1027`, `0x185 10 27`), and filters for frames (`180-1FF`, `node=5`, `5:tpdo1`)."""

from __future__ import annotations

import re
from collections.abc import Callable

from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import Frame

#: maximum length of a line
_MOST_CHARACTERS = 400
_COMPACT = re.compile(r"([0-9A-F]{1,8})#(#?)(R[0-8]?|[0-9A-F._]*)", re.I)
_CANDUMP = re.compile(r"(?:\([-\d .:]+\)\s*)?(?:(?P<interface>\S+)\s+)?(?P<rest>\S.*)")
_SPACED = re.compile(
    r"(?:0x)?([0-9A-F]{1,8})(?:\s+\[(\d{1,2})\])?((?:\s+(?:0x)?[0-9A-F]{2})*|\s+remote request.*)", re.I
)
_ASIDE = re.compile(r"(?<!\s)(?:\s+'.*'$|\s{2,}(?:ERRORFRAME|[A-Z-]+)$|\s+[TR]$)")
_MOST_STANDARD, _MOST_EXTENDED = 0x7FF, 0x1FFF_FFFF
_SHORT_DIGITS, _MOST_BYTES, _MOST_SHOWN = 3, 8, 60


def typed_frame(text: str) -> Frame:
    """The frame in *text*; more than three hex digits are a CAN-ID of 29 bits.

    Raises ValueError with the reason if it is not a frame.
    """
    line = " ".join(text[: _MOST_CHARACTERS + 1].split())
    if len(line) > _MOST_CHARACTERS:
        raise ValueError("a frame is one short line")
    found = _CANDUMP.fullmatch(line)
    for words in (line, found["rest"] if found else ""):
        frame = _compact(words.strip()) or _spaced(_ASIDE.sub("", words.strip()))
        if frame is not None:
            return frame
    raise ValueError(f"{_shortened(line) or 'nothing'!r} is not a frame")


def _shortened(line: str) -> str:
    return line if len(line) <= _MOST_SHOWN else f"{line[: _MOST_SHOWN - 1]}…"


def frame_text(frame: Frame) -> str:
    """*frame* as input for `typed_frame`: `185#1027000000`."""
    digits = 8 if frame.extended else _SHORT_DIGITS
    behind = f"R{frame.dlc or ''}" if frame.remote else frame.data.hex().upper()
    return f"{frame.can_id:0{digits}X}#{behind}"


def _compact(line: str) -> Frame | None:
    found = _COMPACT.fullmatch(line.split(" ", maxsplit=1)[0]) if line else None
    if found is None or " " in _ASIDE.sub("", line):
        return None
    digits, flexible, data = found.groups()
    if flexible:
        raise ValueError("a CAN FD frame: CANopen (CiA 301) uses classical CAN")
    if data[:1] in ("R", "r"):
        return _frame(digits, b"", remote=True, dlc=int(data[1:] or 0))
    data = data.replace(".", "").replace("_", "")
    if len(data) % 2:
        raise ValueError(f"{data} has half a byte")
    return _frame(digits, bytes.fromhex(data))


def _spaced(line: str) -> Frame | None:
    found = _SPACED.fullmatch(line)
    if found is None:
        return None
    digits, length, rest = found.groups()
    if rest.strip().lower().startswith("remote"):
        return _frame(digits, b"", remote=True, dlc=int(length or 0))
    data = bytes(int(word, 16) for word in rest.split())
    if length is not None and int(length) != len(data):
        raise ValueError(f"[{length}] differs from the {len(data)} bytes after it")
    return _frame(digits, data)


def _frame(digits: str, data: bytes, *, remote: bool = False, dlc: int = 0) -> Frame:
    can_id = int(digits, 16)
    if can_id > _MOST_EXTENDED:
        raise ValueError(f"0x{can_id:X} is not a CAN-ID: it has more than 29 bits")
    if max(len(data), dlc) > _MOST_BYTES:
        raise ValueError(f"{max(len(data), dlc)} bytes: a frame has 8 at most")
    extended = len(digits) > _SHORT_DIGITS
    if can_id > _MOST_STANDARD and not extended:
        raise ValueError(f"0x{can_id:X} is above 0x7FF: a CAN-ID of 29 bits has 8 digits, {can_id:08X}")
    return Frame(can_id, data, extended=extended, remote=remote, dlc=dlc)


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
_MOST_NODE = 127


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
    raise ValueError(f"{text!r} does not select frames: {HOW}")


def _range(first: str, last: str) -> FrameFilter:
    low, high = _can_id(first), _can_id(last)
    if low > high:
        raise ValueError(f"{first}-{last} is empty: the lower CAN-ID comes first")
    extended = high > _MOST_STANDARD or max(len(first), len(last)) > _SHORT_DIGITS
    return lambda frame, *_service: frame.extended is extended and low <= frame.can_id <= high


def _can_id(digits: str) -> int:
    can_id = int(digits, 16)
    if can_id > _MOST_EXTENDED:
        raise ValueError(f"0x{can_id:X} is not a CAN-ID: it has more than 29 bits")
    return can_id


def _node_id(digits: str) -> int:
    if not 1 <= int(digits) <= _MOST_NODE:
        raise ValueError(f"node-ID {digits} is outside 1…127")
    return int(digits)

"""The values of a whole device as JSON lines: the device in the first line, an object in each other line.

    {"schema": "dvtcli.whole-device/1", "node": 5, "identity": {…}, "made": "2026-11-23T00:40:00.000000Z", "objects": 2}
    {"object": "1017:00", "type": "u16", "raw": "E8 03"} {"object": "1003:01", "why": "no data available (0x08000024)"}

Needs no EDS.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from dvtcli.errors import InputFileError
from dvtcli.files.input_file import json_line, read_input

SUFFIX = ".jsonl"
SCHEMA = "dvtcli.whole-device/1"
#: enough for some thousand objects, a few of them long
_MOST_BYTES = 64 << 20
_OBJECT = re.compile(r"([0-9A-Fa-f]{4}):([0-9A-Fa-f]{2})")
_TEXT = "{} does not contain the values of a device"
_IDENTITY = ("vendor", "product", "revision", "serial")


class KeptObject(NamedTuple):
    """An object: its *data*, or *why* it is unknown; *type_name* is the short name of its type, empty if unknown."""

    data: bytes | None = None
    why: str = ""
    type_name: str = ""


@dataclass(frozen=True, slots=True)
class KeptDevice:
    """A saved device: *node_id*, *identity* (0x1018), date *made* (RFC 3339), *objects* by place.

    *eds* is the name of the describing file, empty for none.
    """

    node_id: int
    identity: Mapping[str, int | None]
    made: str
    objects: Mapping[tuple[int, int], KeptObject] = field(default_factory=dict)
    eds: str = ""


def whole_device_text(kept: KeptDevice) -> str:
    """Return *kept* as the text of a file."""
    head = {"schema": SCHEMA, "node": kept.node_id, "identity": dict(kept.identity), "made": kept.made,
            "eds": kept.eds or None, "objects": len(kept.objects)}  # fmt: skip
    return "".join(json.dumps(line) + "\n" for line in (head, *map(_line, sorted(kept.objects.items()))))


def _line(item: tuple[tuple[int, int], KeptObject]) -> dict[str, str]:
    (index, sub_index), one = item
    said = {"object": f"{index:04X}:{sub_index:02X}"} | ({"type": one.type_name} if one.type_name else {})
    return said | ({"why": one.why} if one.data is None else {"raw": one.data.hex(" ").upper()})


def read_whole_device(path: Path) -> KeptDevice:
    """Read the file at *path*. Raises OSError if unreadable, InputFileError, with the line, if malformed."""
    data = read_input(path, _MOST_BYTES, "backup")
    lines = list(_documents(path, data))
    if not lines or lines[0][1].get("schema") != SCHEMA:
        raise _wrong(path, 1, f"its first line is not {SCHEMA}")
    head, objects = lines[0][1], _objects(path, lines[1:])
    if head.get("objects") != len(objects):
        why = f"it has {len(objects)} objects, and its first line says {head.get('objects')}: it may be truncated"
        raise _wrong(path, lines[-1][0], why)
    node_id, said = head.get("node"), head.get("identity")
    if not isinstance(node_id, int) or not 1 <= node_id <= 127 or not isinstance(said, dict):
        raise _wrong(path, 1, "it has no node-ID or no identity")
    identity = {name: number if isinstance(number := said.get(name), int) else None for name in _IDENTITY}
    return KeptDevice(node_id, identity, str(head.get("made", "")), objects, str(head.get("eds") or ""))


def _documents(path: Path, data: bytes) -> Iterator[tuple[int, dict[str, Any]]]:
    for number, line in enumerate(data.splitlines(), 1):
        if not line.strip():
            continue
        document = json_line(line, f"{path}:{number}", _TEXT.format(path))
        if not isinstance(document, dict):
            raise _wrong(path, number, "a line is an object of JSON")
        yield number, document


def _objects(path: Path, lines: Iterable[tuple[int, dict[str, Any]]]) -> dict[tuple[int, int], KeptObject]:
    found: dict[tuple[int, int], KeptObject] = {}
    at: dict[tuple[int, int], int] = {}
    for number, line in lines:
        place, one = _object(path, number, line)
        if place in found:
            raise _wrong(path, number, f"{place[0]:04X}:{place[1]:02X} is in line {at[place]} too")
        found[place], at[place] = one, number
    return found


def _object(path: Path, number: int, line: Mapping[str, Any]) -> tuple[tuple[int, int], KeptObject]:
    place, raw = _OBJECT.fullmatch(str(line.get("object"))), line.get("raw")
    if place is None:
        raise _wrong(path, number, 'no "object", such as "1017:00"')
    try:
        data = None if raw is None else bytes.fromhex(raw)
    except (TypeError, ValueError):
        raise _wrong(path, number, '"raw" is not bytes in hexadecimal') from None
    one = KeptObject(data, "" if data is not None else str(line.get("why") or "not read"), str(line.get("type") or ""))
    return (int(place[1], 16), int(place[2], 16)), one


def _wrong(path: Path, line: int, why: str) -> InputFileError:
    return InputFileError(_TEXT.format(path), place=f"{path}:{line}", why=why)

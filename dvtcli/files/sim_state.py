"""The non-volatile memory of a simulated node: a JSON file per node."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from dvtcli.device.change.private_file import put_in_place, to_disk
from dvtcli.errors import InputFileError
from dvtcli.files.input_file import read_input

SCHEMA = "dvtcli.sim-state/1"
#: maximum size (bytes), for some thousand objects
_MOST_BYTES = 10_000_000

Values = dict[tuple[int, int], bytes]


@dataclass(frozen=True, slots=True)
class Kept:
    """A node's stored state: *node_id* (1..127, 255 for none; None: nothing stored) and *values* by object."""

    node_id: int | None = None
    values: Values = field(default_factory=dict)


def read_state(path: Path) -> Kept:
    """Read the state in *path*, empty if absent. Raises InputFileError if malformed."""
    try:
        text = read_input(path, _MOST_BYTES, "state of a simulated node")
    except FileNotFoundError:
        return Kept()
    except OSError as failed:
        raise _wrong(path, failed.strerror or str(failed)) from failed
    try:
        document = json.loads(text)
        if not isinstance(document, dict) or document.get("schema") != SCHEMA:
            raise _wrong(path, f"its schema is not {SCHEMA}")
        values = dict(_value(place, data) for place, data in document["values"].items())
        return Kept(_node_id(document["node"]), values)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as wrong:
        raise _wrong(path, f"it is not {SCHEMA}: {wrong}") from wrong


def _node_id(number: object) -> int:
    if not isinstance(number, int) or not (1 <= number <= 127 or number == 255):
        raise ValueError(f"no such node-ID: {number!r}")
    return number


def _value(place: str, data: str) -> tuple[tuple[int, int], bytes]:
    index, sub_index = (int(number, 16) for number in place.split(":"))
    if not (0 <= index <= 0xFFFF and 0 <= sub_index <= 0xFF):
        raise ValueError(f"no such object: {place}")
    return (index, sub_index), bytes.fromhex(data)


def write_state(path: Path, node_id: int, values: Mapping[tuple[int, int], bytes]) -> None:
    """Write *node_id* and *values* to *path* completely, or keep the old file and raise OSError."""
    document = {
        "schema": SCHEMA,
        "node": node_id,
        "values": {f"{index:04X}:{sub:02X}": data.hex(" ").upper() for (index, sub), data in sorted(values.items())},
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f"{path.name}.{os.getpid()}.new")
    try:
        with draft.open("w", encoding="ascii") as file:
            file.write(json.dumps(document, indent=1) + "\n")
            file.flush()
            to_disk(file.fileno())
        put_in_place(draft, path)
    finally:
        draft.unlink(missing_ok=True)


def _wrong(path: Path, why: str) -> InputFileError:
    return InputFileError(
        f"{path}: not a state file of a simulated node",
        place=str(path),
        why=why,
        hint="remove it: the node starts with its defaults",
    )

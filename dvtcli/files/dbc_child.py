"""The process in which cantools reads a DBC file: a file of some hundred bytes can make it take all memory, or hours.

Reads the text on stdin, says on stdout what the messages are, or what is wrong, as JSON. Imports nothing of dvtcli but
its neighbour.
"""

from __future__ import annotations

import json
import os
import re
import sys
import types
from collections.abc import Iterator
from importlib.util import find_spec
from typing import Any

from dvtcli.files.bounded_child import die_of, limit

#: what it may take: memory (bytes) and time (s)
MOST_MEMORY, MOST_CPU_S = 480 << 20, 9
#: a string, up to the end of the text if nothing closes it
_STRING = r'"(?:\\"|[^"])*+(?:"|\Z)'
#: Comments and names of values are not shown, and are half of many files; a string elsewhere may look like them.
_UNUSED = re.compile(
    rf'^[ \t]*(?:CM_|VAL_|VAL_TABLE_)\s(?:[^";]|{_STRING})*+(?:(?P<end>;)|\Z)|{_STRING}|//[^\n]*', re.MULTILINE
)


def main() -> None:
    """Answer with the messages of the DBC on stdin, then end the process."""
    try:
        limit(MOST_MEMORY, MOST_CPU_S)
        text = sys.stdin.buffer.read().decode("cp1252", errors="replace")
        answer = json.dumps(_read(_UNUSED.sub(_without, text)))
        sys.stdout.buffer.write(answer.encode("ascii"))
        sys.stdout.buffer.flush()
    except BaseException as bug:  # noqa: BLE001 - nobody above: the parent reads of it
        die_of(bug)
    os._exit(0)


def _without(found: re.Match[str]) -> str:
    """Nothing but the line ends of a statement that is not used and ends, so that lines keep their numbers."""
    return "\n" * found[0].count("\n") if found["end"] else found[0]


def _read(text: str) -> dict[str, Any]:
    """The messages that *text* describes, as `dbc.read_dbc` takes them, or what is *wrong* with it."""
    database = _database()
    try:
        database.add_dbc_string(text)
        return {"messages": [_message(message) for message in database.messages]}
    except MemoryError:
        raise
    except Exception as wrong:  # noqa: BLE001 - cantools raises what it comes across
        return {"wrong": str(wrong).partition("\n")[0][:1000] or type(wrong).__name__}


def _database() -> Any:
    """An empty database of cantools, whose package would import python-can, which no file needs."""
    spec = find_spec("cantools")
    assert spec is not None  # noqa: S101 - the parent has looked
    package = types.ModuleType("cantools")
    package.__path__ = list(spec.submodule_search_locations or ())
    sys.modules["cantools"] = package
    from cantools.database.can.database import Database

    return Database()


def _message(message: Any) -> dict[str, Any]:
    signals = [_signal(signal) for signal in message.signals]
    return {"id": message.frame_id, "extended": bool(message.is_extended_frame), "name": message.name,
            "length": message.length, "signals": signals}  # fmt: skip


def _signal(signal: Any) -> dict[str, Any]:
    return {
        "name": signal.name, "start": signal.start, "bits": signal.length,
        "big_endian": signal.byte_order == "big_endian", "signed": bool(signal.is_signed),
        "real": bool(signal.is_float), "scale": signal.scale, "offset": signal.offset, "unit": signal.unit or "",
        "multiplexor": signal.multiplexer_signal, "chosen_by": list(_ranges(sorted(set(signal.multiplexer_ids or ())))),
    }  # fmt: skip


def _ranges(numbers: list[int]) -> Iterator[tuple[int, int]]:
    """*numbers*, which are sorted, as ranges, each with its first and last one."""
    first: int | None = None
    last = 0
    for number in numbers:
        if first is not None and number == last + 1:
            last = number
            continue
        if first is not None:
            yield first, last
        first = last = number
    if first is not None:
        yield first, last

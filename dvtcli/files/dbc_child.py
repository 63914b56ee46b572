"""The process in which cantools reads a DBC file: a file of some hundred bytes can make it take all memory, or hours.

Reads the text on stdin, says on stdout what the messages are, or what is wrong, as JSON. Imports nothing of dvtcli but
its neighbours.
"""

from __future__ import annotations

import gc
import json
import os
import sys
import types
from collections.abc import Iterator
from importlib.util import find_spec
from typing import Any

from dvtcli.files.bounded_child import die_of, limit
from dvtcli.files.dbc_plain import in_order, without_plain

#: what it may take: memory (bytes) and time (s)
MOST_MEMORY, MOST_CPU_S = 480 << 20, 7


def main() -> None:
    """Answer with the messages of the DBC on stdin, then end the process."""
    try:
        limit(MOST_MEMORY, MOST_CPU_S)
        gc.disable()  # it looks at millions of tokens again and again, of which none is free before the end
        text = sys.stdin.buffer.read().decode("cp1252", errors="replace")
        answer = json.dumps(_read(text))
        sys.stdout.buffer.write(answer.encode("ascii"))
        sys.stdout.buffer.flush()
    except BaseException as bug:  # noqa: BLE001 - nobody above: the parent reads of it
        die_of(bug)
    os._exit(0)


def _read(text: str) -> dict[str, Any]:
    """The messages that *text* describes, as `dbc.read_dbc` takes them, or what is *wrong* with it."""
    plain, rest = without_plain(text)
    if plain and not rest:
        return {"messages": plain}
    database = _database()
    try:
        database.add_dbc_string(rest)
    except MemoryError:
        raise
    except Exception as wrong:  # noqa: BLE001 - cantools raises what it comes across
        return {"wrong": str(wrong).partition("\n")[0][:1000] or type(wrong).__name__}
    return {"messages": in_order(text, [*plain, *(_message(message) for message in database.messages)])}


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

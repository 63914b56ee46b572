"""Parse a DBC file with cantools in a child process: a few hundred bytes can cost all memory, or hours.

Reads the text on stdin; writes the messages, or the error, as JSON to stdout. Imports only its neighbours of dvtcli.
"""

from __future__ import annotations

import gc
import json
import os
import re
import sys
import types
from collections import Counter
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from typing import Any

from dvtcli.files.bounded_child import die_of, limit

_STRING, _NUMBER, _NAME = r'"(?:\\"|[^"])*+"', r"[-+]?\d{1,15}(?:\.\d{0,15})?(?:[eE][-+]?\d{1,3})?", r"[A-Za-z_]\w*+"
#: Where something may begin that need not be read, and what may have anything in it: a string, which goes to the end of
#: the text if nothing closes it, and a comment. The list behind `NS_:` has nothing in the line of a keyword.
_PART = re.compile(
    r'^[ \t]*+(?P<keyword>BO_|CM_|VAL_|VAL_TABLE_|BA_|BO_TX_BU_)[ \t]|"(?:\\"|[^"])*+(?:"|\Z)|//[^\n]*+', re.MULTILINE
)
#: unused statements, by keyword
_OBJECT = r"(?:(?:SG_\s++\d++\s++\w++|BO_\s++\d++|(?:BU_|EV_)\s++\w++)\s*+)?"
_NAMES_OF_VALUES = rf"(?:[-+]?\d[\d.]*+\s*+{_STRING}\s*+)*+;"
_UNUSED = {
    "CM_": re.compile(rf"CM_[ \t]++{_OBJECT}{_STRING}\s*+;", re.ASCII),
    "VAL_": re.compile(rf"VAL_[ \t]++(?:\d++[ \t]++)?{_NAME}\s++{_NAMES_OF_VALUES}", re.ASCII),
    "VAL_TABLE_": re.compile(rf"VAL_TABLE_[ \t]++{_NAME}\s++{_NAMES_OF_VALUES}", re.ASCII),
    "BA_": re.compile(
        rf'BA_[ \t]++(?!"System(?:Message|Signal)LongSymbol"){_STRING}\s*+{_OBJECT}'
        rf"(?:[-+]?[\d.][\w.+-]*+|{_STRING})\s*+;",
        re.ASCII,
    ),
    "BO_TX_BU_": re.compile(r"BO_TX_BU_[ \t]++\d++\s*+:\s*+\w++\s*+(?:,\s*+\w++\s*+)*+;", re.ASCII),
}
#: a message after `BO_`, and an unmultiplexed signal: a line each
_MESSAGE = re.compile(
    rf"[ \t]*+(\d{{1,10}})[ \t]++({_NAME})[ \t]*+:[ \t]*+(\d{{1,4}})[ \t]++({_NAME})[ \t]*+\r?\n", re.ASCII
)
_SIGNAL = re.compile(
    rf"[ \t]*+SG_[ \t]++({_NAME})[ \t]*+:[ \t]*+(\d{{1,5}})\|(\d{{1,5}})@([01])([-+])[ \t]*+"
    rf"\(({_NUMBER}),({_NUMBER})\)[ \t]*+\[{_NUMBER}\|{_NUMBER}\][ \t]*+"
    rf'"([^"\\\n]*+)"[ \t]*+({_NAME}(?:[ \t]*+,[ \t]*+{_NAME})*+)[ \t]*+\r?\n',
    re.ASCII,
)
#: forbidden beginnings of the line after a message
_GOES_ON = re.compile(r"\s*+(?:SG_|//|,)")
#: the numbers of messages, and of those of which something is said elsewhere: how signals are chosen, their type, names
_BEGINNING = re.compile(r"\bBO_\s++(\d{1,15})")
_GAP = r"\s*+(?://[^\n]{0,99}\n\s*+){0,3}"
_ELSEWHERE = re.compile(
    rf'(?:SG_MUL_VAL_|SIG_VALTYPE_|"System(?:Message|Signal)LongSymbol"{_GAP}(?:BO_|SG_)){_GAP}[-+]?(\d{{1,15}})'
)
#: the format's keywords, not accepted as names by cantools, and pseudo messages
_NO_NAME = re.compile(r"[A-Z_]*_|FILTER|VERSION|VECTOR__INDEPENDENT_SIG_MSG")
_COMMENT = re.compile(r"//[^\n]*+")
_EXTENDED, _ID_BITS, _EXTENDED_ID_BITS = 1 << 31, 11, 29


def without_plain(text: str) -> tuple[list[dict[str, Any]], str]:
    """Split *text* into its plain messages and the rest; the rest keeps its line numbers.

    The rest is empty if only comments are left.
    """
    plain: list[dict[str, Any]] = []
    rest: list[str] = []
    kept = place = 0
    said_of = _said_of(text)
    while found := _PART.search(text, place):
        place = found.end()
        keyword = found["keyword"]
        if keyword is None:
            continue
        if keyword == "BO_":
            message, end = _plain_message(text, place, said_of)
            if message is not None:
                plain.append(message)
        else:
            unused = _UNUSED[keyword].match(text, found.start("keyword"))
            end = unused.end() if unused else 0
        if end:
            rest += (text[kept : found.start()], "\n" * text.count("\n", found.start(), end))
            place = kept = end
    rest.append(text[kept:])
    is_empty = not any(_COMMENT.sub("", part).strip() for part in rest)
    return plain, "" if is_empty else "".join(rest)


def in_order(text: str, messages: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Sort *messages* by their order in *text*."""
    places: dict[int, int] = {}
    for found in _BEGINNING.finditer(text):
        places.setdefault(int(found[1]), found.start())
    return sorted(messages, key=lambda said: places.get(said["id"] | _EXTENDED * said["extended"], len(text)))


def _said_of(text: str) -> frozenset[int]:
    """Return the numbers of messages that are described twice, or have statements elsewhere."""
    described = Counter(int(number) for number in _BEGINNING.findall(text))
    twice = (number for number, count in described.items() if count > 1)
    return frozenset((*twice, *(int(number) for number in _ELSEWHERE.findall(text))))


def _plain_message(text: str, place: int, said_of: frozenset[int]) -> tuple[dict[str, Any] | None, int]:
    """Return the message whose number is at *place*, and its end; None, 0 if the message is not plain."""
    found = _MESSAGE.match(text, place)
    if not found or int(found[1]) in said_of:
        return None, 0
    end, lines = found.end(), []
    while line := _SIGNAL.match(text, end):
        lines.append(line.groups())
        end = line.end()
    number, length, signals = int(found[1]), int(found[3]), [_plain_signal(line) for line in lines]
    extended, can_id = bool(number & _EXTENDED), number & ~_EXTENDED
    names = {found[2], found[4]}.union(*((line[0], *line[8].replace(",", " ").split()) for line in lines))
    if (
        can_id >> (_EXTENDED_ID_BITS if extended else _ID_BITS)
        or any(_NO_NAME.fullmatch(name) for name in names)
        or not _lie_apart(signals, length)
        or _GOES_ON.match(text, end)
    ):
        return None, 0
    signals.sort(key=_begin)
    return {"id": can_id, "extended": extended, "name": found[2], "length": length, "signals": signals}, end


def _plain_signal(line: tuple[str, ...]) -> dict[str, Any]:
    name, start, bits, order, sign, scale, offset, unit, _ = line
    return {
        "name": name, "start": int(start), "bits": int(bits), "big_endian": order == "0", "signed": sign == "-",
        "real": False, "scale": _number(scale), "offset": _number(offset), "unit": unit, "multiplexor": None,
        "chosen_by": [],
    }  # fmt: skip


def _number(text: str) -> float:
    try:
        return int(text)
    except ValueError:
        return float(text)


def _begin(signal: Mapping[str, Any]) -> int:
    """Return a signal's first bit, counted in its byte order."""
    start: int = signal["start"]
    return 8 * (start // 8) + 7 - start % 8 if signal["big_endian"] else start


def _lie_apart(signals: list[dict[str, Any]], length: int) -> bool:
    """Whether *signals* have unique names and do not overlap in a message of *length* bytes."""
    used = 0
    for begin, signal in ((_begin(signal), signal) for signal in signals):
        bits = signal["bits"]
        if bits < 1 or begin + bits > 8 * length:
            return False
        mask = (1 << bits) - 1
        if signal["big_endian"]:
            mask = int.from_bytes((mask << 8 * length - begin - bits).to_bytes(length, "big"), "little")
        else:
            mask <<= begin
        if used & mask:
            return False
        used |= mask
    return len({signal["name"] for signal in signals}) == len(signals)


#: limits of memory (bytes) and CPU time (s)
MOST_MEMORY, MOST_CPU_S = 480 << 20, 7


def main() -> None:
    """Write the messages of the DBC on stdin to stdout, then end the process."""
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
    """Return the messages of *text* in the form of `dbc.read_dbc`, or the error as `wrong`."""
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
    """Return an empty cantools database without the package's import of python-can."""
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
    """Group sorted *numbers* into ranges, each with first and last number."""
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

"""Requests to a gateway, and their parser: any line gives a request or a GatewayRequestError."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum, auto

from dvtcli.domain.gateway.gateway_words import (
    GatewayError,
    GatewayRequestError,
    data_of,
    number_of,
    type_word,
    words_of,
    wrong,
)
from dvtcli.domain.nmt import NmtCommand

_U8, _U16, _U32 = (0, 0xFF), (0, 0xFFFF), (0, 0xFFFF_FFFF)
#: maximum settable time, ten minutes (ms)
_MOST_MS = (1, 600_000)
#: the gateway's own PDOs are counted 1…512
PDO_NUMBERS = (1, 512)


class Level(Enum):
    """Allowed prefix of a command: nothing, a net, or a net and a node."""

    GATEWAY = auto()
    NET = auto()
    NODE = auto()


@dataclass(frozen=True, slots=True)
class Read:
    """SDO upload; *data_type* is a word of `value_words.TYPES`, None if the gateway chooses."""

    index: int
    sub_index: int
    data_type: str | None


@dataclass(frozen=True, slots=True)
class Write:
    """SDO download of *data*, a value of *data_type*."""

    index: int
    sub_index: int
    data_type: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Nmt:
    """An NMT command."""

    command: NmtCommand


@dataclass(frozen=True, slots=True)
class Order:
    """Any other command with numbers, by its words in `ORDERS`."""

    name: str
    numbers: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class PdoEntry:
    """Part of the gateway's own PDO: an object of *data_type*, or a gap if *index* is None."""

    data_type: str
    index: int | None = None
    sub_index: int = 0


@dataclass(frozen=True, slots=True)
class SetPdo:
    """Set up the gateway's own PDO *number*; *transmission* is `event`, `rtr` or `sync0`…`sync240`."""

    is_tpdo: bool
    number: int
    cob_id: int
    transmission: str
    entries: tuple[PdoEntry, ...]


@dataclass(frozen=True, slots=True)
class ReadPdo:
    """Read the last data received by the gateway's RPDO *number*."""

    number: int


@dataclass(frozen=True, slots=True)
class WritePdo:
    """Transmit the gateway's TPDO *number*; its set-up defines the types of *values*."""

    number: int
    values: tuple[str, ...]


Command = Read | Write | Nmt | Order | SetPdo | ReadPdo | WritePdo


@dataclass(frozen=True, slots=True)
class Request:
    """One line: its *sequence* number (None for none), *net* and *node* if given, and the command."""

    sequence: int | None
    net: int | None
    node: int | None
    command: Command


@dataclass(frozen=True, slots=True)
class Shape:
    """Prefix of an order, and ranges and required count (None: all) of its numbers."""

    level: Level
    ranges: tuple[tuple[int, int], ...] = ()
    least: int | None = None


#: orders by their words
ORDERS = {
    "set network": Shape(Level.GATEWAY, (_U16,)),
    "set node": Shape(Level.NET, (_U8,)),
    "set sdo_timeout": Shape(Level.NET, (_MOST_MS,)),
    "set command_timeout": Shape(Level.NET, (_MOST_MS,)),
    "set sdo_block": Shape(Level.NET, ((0, 1),)),
    "set heartbeat": Shape(Level.NET, (_U16,)),
    "set id": Shape(Level.NET, (_U8,)),
    "set command_size": Shape(Level.GATEWAY, ((1, 0xFFFF_FFFF),)),
    "init": Shape(Level.NET, (_U8,)),
    "info version": Shape(Level.NET),
    "boot_up_indication enable": Shape(Level.NET),
    "boot_up_indication disable": Shape(Level.NET),
    "enable guarding": Shape(Level.NODE, (_U16, _U8)),
    "disable guarding": Shape(Level.NODE),
    "enable heartbeat": Shape(Level.NODE, ((1, 0xFFFF),)),
    "disable heartbeat": Shape(Level.NODE),
    "help": Shape(Level.GATEWAY),
    "help datatype": Shape(Level.GATEWAY),
    "help lss": Shape(Level.GATEWAY),
    "lss_switch_glob": Shape(Level.NET, ((0, 1),)),
    "lss_switch_sel": Shape(Level.NET, (_U32,) * 4),
    "lss_set_node": Shape(Level.NET, (_U8,)),
    "lss_conf_bitrate": Shape(Level.NET, (_U8, _U8)),
    "lss_activate_bitrate": Shape(Level.NET, (_U16,)),
    "lss_store": Shape(Level.NET),
    "lss_inquire_addr": Shape(Level.NET, (_U8,), 0),
    "lss_get_node": Shape(Level.NET),
    "lss_identity": Shape(Level.NET, (_U32,) * 6),
    "lss_ident_nonconf": Shape(Level.NET),
    "_lss_fastscan": Shape(Level.NET, (_U16,), 0),
}


def level_of(command: Command) -> Level:
    """Allowed prefix of *command*."""
    if isinstance(command, Order):
        return ORDERS[command.name].level
    return Level.NODE if isinstance(command, Read | Write | Nmt) else Level.NET


_SEQUENCE = re.compile(r"[ \t]*\[[ \t]*(\w{1,12})[ \t]*\]", re.ASCII)
_NUMBER_START = frozenset("0123456789-")
#: maximum entries of a PDO
_MOST_ENTRIES = 64
_NMT = {
    ("start",): NmtCommand.START,
    ("stop",): NmtCommand.STOP,
    ("preop",): NmtCommand.ENTER_PRE_OPERATIONAL,
    ("preoperational",): NmtCommand.ENTER_PRE_OPERATIONAL,
    ("reset", "node"): NmtCommand.RESET_NODE,
    ("reset", "comm"): NmtCommand.RESET_COMMUNICATION,
    ("reset", "communication"): NmtCommand.RESET_COMMUNICATION,
}
_PDO = ("p", "pdo")


def sequence_of(line: str) -> tuple[int | None, str]:
    """The sequence number at the start of *line*, None if missing or not a number, and the rest."""
    match = _SEQUENCE.match(line)
    if match is None:
        return None, line
    try:
        return number_of(match[1], 0, 0xFFFF_FFFF, "the sequence number"), line[match.end() :]
    except GatewayRequestError:
        return None, line


def parse_request(line: str) -> Request | None:
    """The request in *line*, without its line end; None for a comment. Raises GatewayRequestError if invalid."""
    sequence, rest = sequence_of(line)
    words = words_of(rest)
    if not words:
        return None
    if sequence is None and words[0].startswith("["):
        raise wrong("[n] is a sequence number, 0 to 4294967295")
    where: list[int] = []
    while words and words[0][0] in _NUMBER_START and len(where) < 2:
        where.append(number_of(words.pop(0), 0, 0xFFFF, "net or node"))
    if not words:
        raise wrong("a command is missing")
    command = _command(words)
    return Request(sequence, *_addressed(where, level_of(command)), command)


def _addressed(where: list[int], level: Level) -> tuple[int | None, int | None]:
    """Net and node from the numbers *where* before a command."""
    if level is Level.NODE:
        return (where[0] if len(where) == 2 else None), (where[-1] if where else None)
    if len(where) > (level is Level.NET):
        raise wrong("this command takes no node" if level is Level.NET else "this command takes no net")
    return (where[0] if where else None), None


def _command(words: list[str]) -> Command:
    first, rest = words[0].lower(), words[1:]
    second = rest[0].lower() if rest else ""
    if first in ("r", "read"):
        return ReadPdo(_pdo_number(rest[1:])) if second in _PDO else _read(rest)
    if first in ("w", "write"):
        return _write_pdo(rest[1:]) if second in _PDO else _write(rest)
    if first == "set" and second in ("rpdo", "tpdo"):
        return _set_pdo(second == "tpdo", rest[1:])
    for count in (2, 1):
        key = tuple(word.lower() for word in words[:count])
        if len(key) == count and key in _NMT:
            return _alone(Nmt(_NMT[key]), words[count:])
        if len(key) == count and " ".join(key) in ORDERS:
            return _order(" ".join(key), words[count:])
    raise GatewayRequestError(GatewayError.NOT_SUPPORTED, f"{words[0][:20]!r} is not a command of the gateway")


def _alone(command: Nmt, rest: list[str]) -> Nmt:
    if rest:
        raise wrong(f"unexpected {rest[0][:20]!r} after the command")
    return command


def _place(words: list[str]) -> tuple[int, int]:
    if len(words) < 2:
        raise wrong("index and sub-index are missing")
    return number_of(words[0], 0, 0xFFFF, "index"), number_of(words[1], 0, 0xFF, "sub-index")


def _read(words: list[str]) -> Read:
    index, sub_index = _place(words)
    if len(words) > 3:
        raise wrong(f"unexpected {words[3][:20]!r} after the data type")
    return Read(index, sub_index, type_word(words[2]) if len(words) == 3 else None)


def _write(words: list[str]) -> Write:
    index, sub_index = _place(words)
    if len(words) < 4:
        raise wrong("data type and value are missing")
    name = type_word(words[2])
    return Write(index, sub_index, name, data_of(name, words[3:]))


def _order(name: str, words: list[str]) -> Order:
    shape = ORDERS[name]
    least = len(shape.ranges) if shape.least is None else shape.least
    if not least <= len(words) <= len(shape.ranges):
        raise wrong(f"{name} takes {len(shape.ranges)} numbers, not {len(words)}")
    pairs = zip(words, shape.ranges, strict=False)
    return Order(name, tuple(number_of(word, low, high, name) for word, (low, high) in pairs))


def _pdo_number(words: list[str]) -> int:
    if len(words) != 1:
        raise wrong("the number of a PDO is missing, or more follows")
    return number_of(words[0], *PDO_NUMBERS, "PDO")


def _write_pdo(words: list[str]) -> WritePdo:
    if len(words) < 2:
        raise wrong("number of the PDO, number of values and the values are missing")
    many = number_of(words[1], 0, _MOST_ENTRIES, "number of values")
    if len(words) != 2 + many:
        raise wrong(f"{len(words) - 2} values follow, not {many}")
    return WritePdo(_pdo_number(words[:1]), tuple(words[2:]))


def _set_pdo(is_tpdo: bool, words: list[str]) -> SetPdo:
    if len(words) < 4:
        raise wrong("number, COB-ID, transmission and number of entries are missing")
    number, cob_id = _pdo_number(words[:1]), number_of(words[1], 0, 0xFFFF_FFFF, "COB-ID")
    transmission = words[2].lower()
    if transmission not in ("event", "rtr"):
        if not transmission.startswith("sync"):
            raise wrong(f"{words[2][:20]!r} is not event, rtr or sync0 to sync240")
        number_of(transmission.removeprefix("sync"), 0, 240, "sync")
    many = number_of(words[3], 0, _MOST_ENTRIES, "number of entries")
    entries = _entries(words[4:])
    if len(entries) != many:
        raise wrong(f"{len(entries)} entries follow, not {many}")
    return SetPdo(is_tpdo, number, cob_id, transmission, entries)


def _entries(words: list[str]) -> tuple[PdoEntry, ...]:
    found: list[PdoEntry] = []
    while words:
        if words[0][0] not in _NUMBER_START:
            found.append(PdoEntry(type_word(words[0])))
            words = words[1:]
            continue
        if len(words) < 3:
            raise wrong("an entry is an index, a sub-index and a data type, or a data type alone")
        found.append(PdoEntry(type_word(words[2]), *_place(words)))
        words = words[3:]
    return tuple(found)

"""Requests to a gateway: read, write, NMT, the gateway's own PDOs, and commands with numbers."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

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

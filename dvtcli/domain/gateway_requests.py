"""Requests to a gateway, and their parser: any line gives a request or a GatewayRequestError."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum, auto

from dvtcli.domain.gateway_words import (
    QUOTED,
    GatewayError,
    GatewayRequestError,
    data_of,
    number_of,
    quoted,
    type_word,
    value_text,
    words_of,
    wrong,
)
from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan, phases
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.objects import STORE_PARAMETERS
from dvtcli.domain.plan import Change, Step
from dvtcli.domain.text import plural

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


_NMT_COMMANDS = {
    NmtCommand.START: "start",
    NmtCommand.STOP: "stop",
    NmtCommand.ENTER_PRE_OPERATIONAL: "preop",
    NmtCommand.RESET_NODE: "reset node",
    NmtCommand.RESET_COMMUNICATION: "reset comm",
}


def format_request(request: Request) -> str:
    """The line for *request*, without its line end."""
    head = [] if request.sequence is None else [f"[{request.sequence}]"]
    where = [str(number) for number in (request.net, request.node) if number is not None]
    return " ".join([*head, *where, _command_text(request)])


def _command_text(request: Request) -> str:
    match request.command:
        case Read(index, sub_index, None):
            return f"r 0x{index:04X} {sub_index}"
        case Read(index, sub_index, data_type):
            return f"r 0x{index:04X} {sub_index} {data_type}"
        case Write(index, sub_index, data_type, data):
            return f"w 0x{index:04X} {sub_index} {data_type} {value_text(data_type, data, wide_as_hex=True)}"
        case Nmt(command):
            return _NMT_COMMANDS[command]
        case Order(name, numbers):
            return " ".join([name, *map(str, numbers)])
        case ReadPdo(number):
            return f"r p {number}"
        case WritePdo(number, values):
            return " ".join([f"w p {number} {len(values)}", *map(_word, values)])
        case SetPdo() as pdo:
            kind = "tpdo" if pdo.is_tpdo else "rpdo"
            head = f"set {kind} {pdo.number} 0x{pdo.cob_id:X} {pdo.transmission} {len(pdo.entries)}"
            return " ".join([head, *map(_entry, pdo.entries)])


def _word(word: str) -> str:
    return quoted(word.removeprefix(QUOTED)) if word.startswith(QUOTED) else word


def _entry(entry: PdoEntry) -> str:
    return entry.data_type if entry.index is None else f"0x{entry.index:04X} {entry.sub_index} {entry.data_type}"


_SAVE = b"save"
#: start of a comment that dvtcli's `run` executes
REQUIRED = "#! require "
_PHASES = ("producers off", "consumers off", "writing", "consumers on", "producers on")


@dataclass(frozen=True, slots=True)
class Around:
    """Actions besides writes for a node.

    *preop*: PDOs can only be set in PRE-OPERATIONAL; *start*: it was OPERATIONAL; *stores*: the sub-indices of 0x1010
    to store.
    """

    preop: bool = False
    start: bool = False
    stores: tuple[int, ...] = ()


def plan_lines(plan: NetworkPlan, around: dict[int, Around]) -> list[str]:
    """Request lines for *plan*, each with a comment above it; only comments if the plan is empty."""
    nodes = [node for node in plan.nodes if len(node.plan) or node.stores]
    lines = [
        f"# CiA 309-3 gateway lines: {plural(plan.writes, 'SDO download')} for {_plain(plan.file)}",
        *map(_who, plan.nodes),
    ]
    lines.append("# Nothing is read back and nothing rolled back: stop at the first answer that is an ERROR.")
    lines += required_lines(nodes)
    commands = list(_commands(nodes, around)) or ["nothing to do: every node already has the values of the file"]
    number = 0
    for command in commands:
        if isinstance(command, str):
            lines.append(f"# {command}")
        else:
            number += 1
            lines.append(format_request(Request(number, None, *command)))
    return lines


def required_lines(node_plans: Iterable[NodePlan]) -> Iterator[str]:
    """Preconditions of the first line: `run` of dvtcli checks them, other programs read comments."""
    for node_plan in node_plans:
        known = [f"{name}=0x{value:08X}" for name, value in node_plan.identity.items() if value is not None]
        if known:
            yield f"{REQUIRED}{node_plan.node_id}:identity {' '.join(known)}"
        if node_plan.needs_power_off:
            yield f"{REQUIRED}{node_plan.node_id}:power-off"


def _commands(node_plans: list[NodePlan], around: dict[int, Around]) -> Iterator[str | tuple[int, Command]]:
    """Comments, and commands with their nodes."""
    for node_id in (
        node_plan.node_id for node_plan in node_plans if len(node_plan.plan) and around[node_plan.node_id].preop
    ):
        yield f"node {node_id}: its PDOs are set in PRE-OPERATIONAL"
        yield node_id, Nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    for title, phase in zip(_PHASES, phases(node_plan.plan for node_plan in node_plans), strict=True):
        for part in phase:
            for change, step in part.steps_in_order():
                yield from _written(part.node_id, change, step, title)
    for node_id in (node_plan.node_id for node_plan in node_plans if node_plan.stores):
        for store in around[node_id].stores:
            yield f"node {node_id}: store"
            yield node_id, Write(STORE_PARAMETERS, store, "vs", _SAVE)
    for node_id in (
        node_plan.node_id for node_plan in node_plans if len(node_plan.plan) and around[node_plan.node_id].start
    ):
        yield f"node {node_id}: it was OPERATIONAL"
        yield node_id, Nmt(NmtCommand.START)


def _written(node_id: int, change: Change, step: Step, title: str) -> Iterable[str | tuple[int, Command]]:
    was = "" if step.before is None else f"; was {_shown(step.before)}"
    yield f"node {node_id}, {title}, {_plain(change.label)}: {_plain(step.reason)}{was}"
    yield node_id, _write_of(step)


def _write_of(step: Step) -> Write:
    """The write of *step*, as a number if its length allows."""
    name = f"u{8 * len(step.after)}" if 1 <= len(step.after) <= 8 else "os"
    return Write(step.index, step.sub_index, name, step.after)


def _shown(data: bytes) -> str:
    if 1 <= len(data) <= 8:
        return f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}"
    return f"{len(data)} bytes"


def _who(node_plan: NodePlan) -> str:
    known = [f"{name} 0x{value:08X}" for name, value in node_plan.identity.items() if value is not None]
    who = " ".join(filter(None, ("node", str(node_plan.node_id), _plain(node_plan.name))))
    return f"# {who}: {', '.join(known) or 'it has no readable identity (0x1018)'}"


def _plain(text: str) -> str:
    """*text* as printable ASCII for a comment."""
    return "".join(char if 0x20 <= ord(char) < 0x7F else "?" for char in text)

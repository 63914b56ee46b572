"""Convert arguments of a program for the operations: PDOs, objects, PDO options. Asks no device."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from reprlib import repr as short
from typing import TYPE_CHECKING, Literal, ParamSpec, TypedDict, TypeVar

from dvtcli.domain.datatypes import BY_SHORT_NAME, DataType, Kind, Value
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.object_syntax import MappedObject, Skipped
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.request import PdoRequest
from dvtcli.domain.times import counts
from dvtcli.errors import UsageError
from dvtcli.operations.api.checks import flag, number, whole, word, wrong
from dvtcli.operations.values.named_objects import entry_at, object_at

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.scaling import Scaling
    from dvtcli.domain.store import ProveBy

P = ParamSpec("P")
T = TypeVar("T")

#: An object: a name of the EDS or an alias (`statusword`), `6C01:1`, an index, or index and sub-index.
Object = str | int | tuple[int, int]
#: A mapping entry: an object, `6C01:1/16` or `dummy/16`, or index, sub-index and length in bits.
Entry = Object | tuple[int, int, int]


class PdoOptions(TypedDict):
    """Options of `Node.map` and `Node.set` besides the mapping; None leaves a parameter unchanged."""

    #: CAN-ID, 1…0x7FF, with `extended` up to 0x1FFFFFFF; `"auto"` or `"keep"`
    cob_id: int | Literal["auto", "keep"] | None
    #: 0…255
    transmission_type: int | None
    #: on every N-th SYNC, 1…240: a transmission type by another name
    sync: int | None
    #: event-driven: transmission type 255
    event: bool | None
    #: inhibit time in ms, 0…6553.5 in steps of 0.1; 0 is off
    inhibit_ms: float | None
    #: event timer in ms, 0…65535 in steps of 1; 0 is off
    timer_ms: float | None
    #: SYNC start value, 0…240
    sync_start: int | None
    #: bit 30 of the COB-ID: whether the PDO may be asked for by RTR
    rtr: bool | None
    #: a 29-bit CAN-ID
    extended: bool | None
    #: whether the PDO exists on the bus afterwards
    enabled: bool | None


#: A group of 0x1010 and 0x1011, by name or sub-index.
Group = Literal["all", "communication", "application"] | int
_GROUPS = {"all": 1, "communication": 2, "application": 3}
_KINDS: tuple[Literal["transmission_type", "sync", "event"], ...] = ("transmission_type", "sync", "event")
_FLAGS: tuple[Literal["event", "rtr", "extended", "enabled"], ...] = ("event", "rtr", "extended", "enabled")
_AN_OBJECT = "a name of the EDS, '6C01:1', 0x6041 or (0x6C01, 1)"
_AN_ENTRY = f"{_AN_OBJECT}, (0x6C01, 1, 16) or 'dummy/16'"
_ONE_BY_ONE = "give objects one by one, map('tpdo1', '6041', '606C'), or a list with a star, map('tpdo1', *objects)"


def pdo_of(pdo: str | Pdo) -> Pdo:
    """Parse a PDO such as `tpdo1` or `RPDO3`; raises UsageError if invalid."""
    try:
        return pdo if isinstance(pdo, Pdo) else Pdo.parse(word("pdo", pdo, "a PDO is 'tpdo1', 'rpdo3', …"))
    except ValueError as failed:
        raise UsageError(str(failed)) from failed


def object_of(node: Node, object_: Object) -> tuple[int, int]:
    """Return index and sub-index; raises UsageError if invalid, or unknown to *node*."""
    if isinstance(object_, str):
        return object_at(node, object_)
    if not _numbers(object_, 2):
        raise wrong("object_", object_, _AN_OBJECT)
    index, sub_index = object_ if isinstance(object_, tuple) else (object_, 0)
    return whole("index", index, "an index", 0xFFFF), whole("sub_index", sub_index, "a sub-index", 0xFF)


def _numbers(object_: object, most: int) -> bool:
    """Tell whether *object_* is an index, or a tuple of index, sub-index and at most *most* numbers."""
    numbers = object_ if isinstance(object_, tuple) else (object_, 0)
    return 2 <= len(numbers) <= most and all(
        isinstance(value, int) and not isinstance(value, bool) for value in numbers
    )


def _words(entry: object) -> bool:
    """Tell whether *entry* is a tuple of texts: several objects in place of one."""
    return isinstance(entry, tuple) and entry != () and all(isinstance(item, str) for item in entry)


def entry_of(node: Node, entry: Entry) -> MappedObject | Skipped:
    """Return a mapping entry; raises UsageError as `object_of`."""
    if isinstance(entry, str):
        return entry_at(node, entry)
    if isinstance(entry, list) or _words(entry):
        raise UsageError(f"objects: {short(entry)}: {_ONE_BY_ONE}")
    if not _numbers(entry, 3):
        raise UsageError(f"objects: {short(entry)}: {_AN_ENTRY}")
    if isinstance(entry, tuple) and len(entry) == 3:
        return MappedObject(*object_of(node, entry[:2]), whole("bits", entry[2], "a length in bits", 64, low=1))
    return MappedObject(*object_of(node, entry))


def type_of(name: str | None) -> DataType | None:
    """Return a data type by short name (`u16`, `i32`, `r32`, `vs`, …); raises UsageError if unknown."""
    if name is None:
        return None
    if word("as_type", name, f"types are {' '.join(BY_SHORT_NAME)}").lower() not in BY_SHORT_NAME:
        raise UsageError(f"{name!r} is not a type; types are {' '.join(BY_SHORT_NAME)}")
    return BY_SHORT_NAME[name.lower()]


def bytes_of(kind: DataType, meaning: Scaling, value: Value, object_: str) -> bytes:
    """Encode *value* as *kind*, a text such as `48V` by *meaning*; bytes stay. Raises UsageError if it does not fit."""
    from dvtcli.operations.values.object_values import how_to_write, typed_bytes

    if isinstance(value, bytes):
        return value
    if isinstance(value, bool) and kind.kind is not Kind.BOOLEAN:
        raise wrong("value", value, f"0x{object_} is not a BOOLEAN but {kind.short}: a value of that, text or bytes")
    try:
        return typed_bytes(kind, meaning, value) if isinstance(value, str) else kind.encode(value)
    except ValueError as failed:
        hint = how_to_write(meaning, kind, value if isinstance(value, str) else "")
        raise UsageError(f"{value!r} for 0x{object_} ({kind.short}): {failed}", hint=hint) from failed


def group_of(group: Group) -> int:
    """Return the sub-index of 0x1010 or 0x1011 for *group*; raises UsageError if unknown."""
    if isinstance(group, int):
        return whole("group", group, "a sub-index", 127, low=1)
    if not isinstance(group, str) or group not in _GROUPS:
        raise wrong("group", group, f"{', '.join(map(repr, _GROUPS))}, or a sub-index 1…127")
    return _GROUPS[group]


def nmt_command_of(command: str) -> NmtCommand:
    """Return an NMT command by its word; raises UsageError if unknown."""
    found = next((nmt_command for nmt_command in NmtCommand if nmt_command.word == command), None)
    if found is None:
        raise wrong("command", command, ", ".join(repr(nmt_command.word) for nmt_command in NmtCommand))
    return found


def proof_of(prove: object) -> ProveBy | None:
    """The way to prove a store that *prove* means: `reset`, `power`, None for none."""
    if not isinstance(prove, bool) and not (isinstance(prove, str) and prove == "power"):
        raise wrong("prove", prove, "True, False or 'power'")
    return ("power" if prove == "power" else "reset") if prove else None


def known_names(method: Callable[P, T]) -> Callable[P, T]:
    """Make another keyword argument than *method* has a UsageError with the nearest name."""
    code = method.__code__
    known = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]

    @wraps(method)
    def checked(*args: P.args, **named: P.kwargs) -> T:
        for name in named:
            if name not in known:
                raise _unknown(name)
        required = code.co_argcount - len(method.__defaults__ or ())
        if lacking := [name for name in known[len(args) : required] if name not in named]:
            raise UsageError(f"{method.__name__}: {lacking[0]} is missing")
        return method(*args, **named)

    return checked


def _unknown(name: str) -> UsageError:
    from difflib import get_close_matches

    if name == "objects":
        return UsageError(f"objects=…: {_ONE_BY_ONE}")
    options = list(PdoOptions.__annotations__)
    near = get_close_matches(name, options, n=1)
    return UsageError(
        f"{name!r} is not a parameter of a PDO; these are: {', '.join(options)}",
        hint=f"did you mean {near[0]}?" if near else None,
    )


def request(options: PdoOptions) -> PdoRequest:
    """Make the request of *options*; raises UsageError if they are invalid."""
    for name in _FLAGS:
        if (value := options[name]) is not None:
            flag(name, value)
    if sum(options[name] is not None for name in _KINDS) > 1:
        raise UsageError("transmission_type, sync and event exclude each other: give only one of them")
    return PdoRequest(
        cob_id=_cob_id(options["cob_id"]),
        transmission_type=_transmission_type(options),
        inhibit_time=_counts("inhibit_ms", options["inhibit_ms"], 100),
        event_timer=_counts("timer_ms", options["timer_ms"], 1000),
        sync_start_value=_optional("sync_start", options["sync_start"], "a SYNC start value", 240),
        rtr_allowed=options["rtr"],
        extended=options["extended"] or False,
        enabled=options["enabled"],
    )


def _transmission_type(options: PdoOptions) -> int | None:
    if options["event"]:
        return 255
    if (syncs := options["sync"]) is not None:
        return whole("sync", syncs, "a number of SYNCs", 240, low=1)
    return _optional("transmission_type", options["transmission_type"], "a transmission type", 255)


def _cob_id(asked: int | Literal["auto", "keep"] | None) -> int | Literal["auto", "keep"] | None:
    if not isinstance(asked, str):
        return _optional("cob_id", asked, "a CAN-ID", 0x1FFF_FFFF)
    if asked not in ("auto", "keep"):
        number_of = f", cob_id={asked}" if re.fullmatch(r"0x[0-9a-fA-F]+|[1-9][0-9]*", asked) else ""
        raise UsageError(f"cob_id={short(asked)}: a CAN-ID is an int{number_of}; or 'auto' or 'keep'")
    return asked


def _optional(name: str, value: int | None, what: str, high: int) -> int | None:
    return None if value is None else whole(name, value, what, high)


def _counts(name: str, time_ms: float | None, unit_us: int) -> int | None:
    if time_ms is None:
        return None
    try:
        return counts(number(name, time_ms, "a number of milliseconds, 0 or more"), unit_us)
    except ValueError as failed:
        raise UsageError(f"{name}={time_ms!r}: {failed}") from failed

"""What a program hands over, as the operations want it: PDOs, objects, what a PDO is to be. Asks no device."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypedDict

from dvtcli.domain.datatypes import BY_SHORT_NAME, DataType, Value
from dvtcli.domain.milliseconds import counts
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.object_syntax import MappedObject, Skipped
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import UsageError
from dvtcli.operations.named_objects import entry_at, object_at

if TYPE_CHECKING:
    from dvtcli.device.node import Node

#: An object: a name of the EDS or an alias (`statusword`), `6C01:1`, an index, or index and sub-index.
Object = str | int | tuple[int, int]
#: A mapping entry: an object, `6C01:1/16` or `dummy/16`, or index, sub-index and length in bits.
Entry = Object | tuple[int, int, int]


class PdoOptions(TypedDict, total=False):
    """What `Node.map` and `Node.set` may set besides the mapping; what is left out stays as it is."""

    #: CAN-ID, `"auto"` or `"keep"`
    cob_id: int | Literal["auto", "keep"]
    #: 0…255
    transmission_type: int
    #: on every N-th SYNC, 1…240: a transmission type by another name
    sync: int
    #: event-driven: transmission type 255
    event: bool
    #: inhibit time in ms, in steps of 0.1
    inhibit_ms: float
    #: event timer in ms; 0 is off
    timer_ms: float
    #: SYNC start value, 0…240
    sync_start: int
    #: bit 30 of the COB-ID: whether the PDO may be asked for by RTR
    rtr: bool
    #: a 29-bit CAN-ID
    extended: bool
    #: whether the PDO exists on the bus afterwards
    enabled: bool


#: A group of 0x1010 and 0x1011, by name or sub-index.
Group = Literal["all", "communication", "application"] | int
_GROUPS = {"all": 1, "communication": 2, "application": 3}
_KINDS = ("transmission_type", "sync", "event")


def pdo_of(pdo: str | Pdo) -> Pdo:
    """A PDO from `tpdo1`, `RPDO3`; UsageError where it is none."""
    try:
        return pdo if isinstance(pdo, Pdo) else Pdo.parse(pdo)
    except ValueError as wrong:
        raise UsageError(str(wrong)) from wrong


def object_of(node: Node, object_: Object) -> tuple[int, int]:
    """Index and sub-index; UsageError where *node* has no object of that name, or it is none."""
    if isinstance(object_, str):
        return object_at(node, object_)
    index, sub_index = (object_, 0) if isinstance(object_, int) else object_
    return _within(index, "an index", 0xFFFF), _within(sub_index, "a sub-index", 0xFF)


def entry_of(node: Node, entry: Entry) -> MappedObject | Skipped:
    """A mapping entry; UsageError as `object_of`."""
    if isinstance(entry, str):
        return entry_at(node, entry)
    if isinstance(entry, tuple) and len(entry) == 3:
        return MappedObject(*object_of(node, entry[:2]), _within(entry[2], "a length in bits", 64, low=1))
    return MappedObject(*object_of(node, entry))


def type_of(short: str | None) -> DataType | None:
    """A data type by its short name (`u16`, `i32`, `r32`, `vs`, …); UsageError where there is none."""
    if short is not None and short.lower() not in BY_SHORT_NAME:
        raise UsageError(f"{short!r} is not a type; types are {' '.join(BY_SHORT_NAME)}")
    return None if short is None else BY_SHORT_NAME[short.lower()]


def bytes_of(kind: DataType, value: Value, object_: str) -> bytes:
    """*value* as *kind*; bytes go as they are. UsageError where it does not fit."""
    if isinstance(value, bytes):
        return value
    try:
        return kind.parse(value) if isinstance(value, str) else kind.encode(value)
    except ValueError as wrong:
        raise UsageError(f"{value!r} for 0x{object_} ({kind.short}): {wrong}") from wrong


def group_of(group: Group) -> int:
    """The sub-index of 0x1010 or 0x1011 that *group* means; UsageError where it is none."""
    if isinstance(group, int):
        return _within(group, "a sub-index", 127, low=1)
    if group not in _GROUPS:
        raise UsageError(f"{group!r}: {', '.join(_GROUPS)}, or a sub-index 1…127")
    return _GROUPS[group]


def nmt_command_of(word: str) -> NmtCommand:
    """An NMT command by its word; UsageError where there is none."""
    found = next((command for command in NmtCommand if command.word == word), None)
    if found is None:
        raise UsageError(f"{word!r}: {', '.join(command.word for command in NmtCommand)}")
    return found


def request(options: PdoOptions, *, enabled: bool | None) -> PdoRequest:
    """What *options* ask of a PDO; *enabled* is what it becomes where they do not say. UsageError for wrong ones."""
    unknown = options.keys() - PdoOptions.__annotations__.keys()
    if unknown:
        raise UsageError(
            f"{sorted(unknown)[0]!r} is nothing that a PDO has; it has {', '.join(PdoOptions.__annotations__)}"
        )
    if sum(name in options for name in _KINDS) > 1:
        raise UsageError("transmission_type, sync and event exclude each other: give one")
    return PdoRequest(
        cob_id=_cob_id(options.get("cob_id")),
        transmission_type=_transmission_type(options),
        inhibit_time=_counts(options.get("inhibit_ms"), 100),
        event_timer=_counts(options.get("timer_ms"), 1000),
        sync_start_value=_optional(options.get("sync_start"), "a SYNC start value", 240),
        rtr_allowed=options.get("rtr"),
        extended=options.get("extended", False),
        enabled=options.get("enabled", enabled),
    )


def _transmission_type(options: PdoOptions) -> int | None:
    if options.get("event"):
        return 255
    if (syncs := options.get("sync")) is not None:
        return _within(syncs, "a number of SYNCs", 240, low=1)
    return _optional(options.get("transmission_type"), "a transmission type", 255)


def _cob_id(asked: int | Literal["auto", "keep"] | None) -> int | Literal["auto", "keep"] | None:
    if isinstance(asked, str):
        if asked not in ("auto", "keep"):
            raise UsageError(f"cob_id={asked!r}: a CAN-ID, 'auto' or 'keep'")
        return asked
    return _optional(asked, "a CAN-ID", 0x1FFF_FFFF)


def _optional(value: int | None, what: str, high: int) -> int | None:
    return None if value is None else _within(value, what, high)


def _within(value: int, what: str, high: int, *, low: int = 0) -> int:
    if not isinstance(value, int) or not low <= value <= high:
        raise UsageError(f"{value!r}: {what} is {low}…{high}" + (f" (0x{low:X}…0x{high:X})" if high > 255 else ""))
    return value


def _counts(time_ms: float | None, unit_us: int) -> int | None:
    try:
        return None if time_ms is None else counts(time_ms, unit_us)
    except ValueError as wrong:
        raise UsageError(str(wrong)) from wrong

"""PDOs: their place in the dictionary, mapping entries, defaults, configurations, and lists of multiplexed PDOs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, TypedDict, Unpack

from dvtcli.domain.cob_id import CobId, can_id_text

MAX_PDO_NUMBER = 512
EVENT_DRIVEN = 255
#: requestable PDO parameters, by the names in `PdoCommunicationParameter`, and the mapping
MAPPING = "mapping"
PARAMETERS = ("cob_id", "transmission_type", "inhibit_time", "event_timer", "sync_start_value", MAPPING)
#: those of 0x1400 and 0x1800 by their sub-index (CiA 301, 7.5.2.35 and 7.5.2.37; 4 is reserved)
BY_SUB_INDEX = {1: "cob_id", 2: "transmission_type", 3: "inhibit_time", 5: "event_timer", 6: "sync_start_value"}


class Direction(StrEnum):
    """Seen from the device: it sends a TPDO and receives an RPDO."""

    RPDO = "rpdo"
    TPDO = "tpdo"


_COMMUNICATION = {Direction.RPDO: 0x1400, Direction.TPDO: 0x1800}
_MAPPING = {Direction.RPDO: 0x1600, Direction.TPDO: 0x1A00}
_DIRECTIONS = {base: direction for bases in (_COMMUNICATION, _MAPPING) for direction, base in bases.items()}
#: optional parameters, by sub-index of the communication parameter
_OPTIONAL = {2: "transmission type", 3: "inhibit time", 5: "event timer", 6: "SYNC start value"}
PDO_INDICES = range(0x1400, 0x1C00)
_DEFAULT_CAN_ID = {Direction.RPDO: 0x200, Direction.TPDO: 0x180}


@dataclass(frozen=True, slots=True, order=True)
class Pdo:
    """A PDO of a node; *number* is 1..512."""

    direction: Direction
    number: int

    def __post_init__(self) -> None:
        if not 1 <= self.number <= MAX_PDO_NUMBER:
            raise ValueError(f"{self.direction}{self.number}: PDO numbers are 1..{MAX_PDO_NUMBER}")

    @classmethod
    def parse(cls, text: str) -> Pdo:
        """Read `tpdo1` … `tpdo512`, `rpdo1` …, in any case. Raises ValueError with the reason."""
        match = re.fullmatch(r"([rt])(?:x)?pdo(\d{1,9})", text.strip(), re.IGNORECASE | re.ASCII)
        if not match:
            raise ValueError(f"{text!r} is not a PDO; write tpdo1…tpdo512 or rpdo1…rpdo512")
        return cls(Direction.TPDO if match[1] in "tT" else Direction.RPDO, int(match[2]))

    @classmethod
    def at(cls, index: int) -> Pdo | None:
        """The PDO with its communication or mapping parameter at *index*, or None."""
        if index not in PDO_INDICES:
            return None
        base = index - index % MAX_PDO_NUMBER
        return cls(_DIRECTIONS[base], index - base + 1)

    @property
    def is_tpdo(self) -> bool:
        """Whether the PDO is a TPDO."""
        return self.direction is Direction.TPDO

    @property
    def communication_index(self) -> int:
        """Index of the communication parameter: 0x1400 or 0x1800 plus number - 1."""
        return _COMMUNICATION[self.direction] + self.number - 1

    @property
    def mapping_index(self) -> int:
        """Index of the mapping parameter: 0x1600 or 0x1A00 plus number - 1."""
        return _MAPPING[self.direction] + self.number - 1

    def default_can_id(self, node_id: int) -> int | None:
        """CAN-ID of the pre-defined connection set for PDO 1..4 of *node_id* (1..127), else None."""
        if self.number > 4:
            return None
        return _DEFAULT_CAN_ID[self.direction] + 0x100 * (self.number - 1) + node_id

    @property
    def label(self) -> str:
        """The PDO as displayed: `TPDO1`."""
        return f"{self.direction.upper()}{self.number}"

    def __str__(self) -> str:
        return f"{self.direction}{self.number}"


@dataclass(frozen=True, slots=True)
class PdoCommunicationParameter:
    """A communication parameter; None means that the device lacks the sub-index.

    *transmission_type* is 0..255, *inhibit_time* counts 100 µs, *event_timer* counts 1 ms,
    *sync_start_value* is a SYNC counter value 0..255 (CiA 301, 7.5.2.35 and 7.5.2.37).
    """

    cob_id: CobId
    transmission_type: int | None = None
    inhibit_time: int | None = None
    event_timer: int | None = None
    sync_start_value: int | None = None


class PdoParameters(TypedDict, total=False):
    """Fields of a `PdoCommunicationParameter` to replace."""

    cob_id: CobId
    transmission_type: int | None
    inhibit_time: int | None
    event_timer: int | None
    sync_start_value: int | None


@dataclass(frozen=True, slots=True)
class PdoConfig:
    """A PDO's configuration: its communication parameter and its active mapping, in frame order.

    *count* is the mapping's sub-index 0; it differs from the number of entries for MPDOs (0xFE, 0xFF), of which
    *multiplexed* is the content of sub-index 1, not a mapping. The count also
    differs for an inconsistent PDO: *held_count* is its value, *unread* the objects (index, sub-index) that
    are missing or unreadable: the COB-ID (disabled then), the count, or the first entry behind *mapping*; or
    an optional parameter (None then), refused for a temporary reason.
    """

    communication: PdoCommunicationParameter
    mapping: tuple[PdoMappingEntry, ...]
    mpdo: int | None = None
    held_count: int | None = None
    unread: tuple[tuple[int, int], ...] = ()
    multiplexed: tuple[PdoMappingEntry, ...] = ()

    @property
    def entries(self) -> tuple[PdoMappingEntry, ...]:
        """Contents of the mapping's sub-indices 1 and up, as far as meaningful."""
        return self.mapping if self.mpdo is None else self.multiplexed

    @property
    def enabled(self) -> bool:
        """Whether the PDO exists on the bus (bit 31 clear)."""
        return self.communication.cob_id.valid

    @property
    def count(self) -> int:
        """Mapping sub-index 0 as read from the device."""
        odd = self.held_count if self.mpdo is None else self.mpdo
        return len(self.mapping) if odd is None else odd

    @property
    def has_cob_id(self) -> bool:
        """Whether the COB-ID is readable; without COB-ID the PDO is not on the bus."""
        return not any(sub_index == 1 and not is_mapping_index(index) for index, sub_index in self.unread)

    @property
    def has_mapping(self) -> bool:
        """Whether the mapping's count is readable."""
        return all(_is_entry(*place) for place in self.unread if is_mapping_index(place[0]))

    @property
    def lacking(self) -> tuple[tuple[int, int], ...]:
        """Objects of *unread* that are essential whatever the PDO maps: parameters, and the mapping's count."""
        return tuple(place for place in self.unread if not _is_entry(*place))

    @property
    def untold(self) -> tuple[tuple[int, int], ...]:
        """Optional objects of *unread*: their existence and values are unknown."""
        return tuple(place for place in self.lacking if place[1] in _OPTIONAL)

    @property
    def inconsistency(self) -> str:
        """Description of the PDO's inconsistency, empty for a consistent PDO."""
        return "; ".join(_inconsistencies(self))

    @property
    def bits(self) -> int:
        """Total length of the mapping in bits."""
        return total_bits(self.mapping)

    def with_parameters(self, **values: Unpack[PdoParameters]) -> PdoConfig:
        """The same PDO with *values* in its communication parameter."""
        return replace(self, communication=replace(self.communication, **values))

    def disabled(self) -> PdoConfig:
        """The same PDO with bit 31 of its COB-ID set."""
        return self.with_parameters(cob_id=self.communication.cob_id.disabled())


def is_mapping_index(index: int) -> bool:
    """Whether *index* (0x1400..0x1BFF) is a mapping parameter, not a communication parameter."""
    return bool(index & 0x200)


def _is_entry(index: int, sub_index: int) -> bool:
    return is_mapping_index(index) and sub_index > 0


def _inconsistencies(config: PdoConfig) -> Iterator[str]:
    without_cob_id = () if config.has_cob_id else config.untold  # other missing parts do not matter then
    for index, sub_index in (place for place in config.unread if place not in without_cob_id):
        place = f"0x{index:04X}:{sub_index:02X}"
        if not is_mapping_index(index):
            yield f"its {_OPTIONAL.get(sub_index, 'COB-ID')} {place} cannot be read"
        elif sub_index == 0:
            yield f"its mapping {place} cannot be read"
        else:
            yield f"its count is {config.count}, but {place} cannot be read"
    if config.held_count is not None and len(config.mapping) == MAX_ENTRIES:
        yield f"its count is {config.held_count}, a PDO has 0..{MAX_ENTRIES} entries"


def is_mpdo(count: int) -> bool:
    """Whether a mapping count marks a multiplexed PDO (0xFE source, 0xFF destination addressing)."""
    return count in (SAM_MPDO, DAM_MPDO)


def transmission_type_text(value: int, direction: Direction) -> str:
    """Transmission type *value* (0..255) in words for *direction* (CiA 301, 7.5.2.35 and 7.5.2.37)."""
    tpdo = direction is Direction.TPDO
    if value == 0:
        return "acyclic, synchronous" if tpdo else "synchronous"
    if value <= 240:
        if not tpdo:
            return "synchronous"
        return "every SYNC" if value == 1 else f"every {value} SYNCs"
    if value >= 254:
        return "event-driven" if tpdo else "immediate"
    if tpdo and value >= 252:
        return "on RTR, synchronous" if value == 252 else "on RTR"
    return "reserved"


def entry_text(text: str) -> str:
    """A mapping entry as text; a dummy in its typed form."""
    return f"dummy/{text.rpartition('/')[2]}" if text.startswith("000") else text


def parameter_text(key: str, value: Any, pdo: Pdo, *, extended: bool = False) -> str:
    """A PDO parameter, by its key in a network file, in the usual notation; a CAN-ID is *extended* or not."""
    if value is None:
        return "-"
    if key == "enabled":
        return "on" if value else "off"
    if key == "cob_id":
        return can_id_text(value, extended=extended)
    if key == "type":
        return f"{value} {transmission_type_text(value, pdo.direction)}"
    if key == "inhibit_time":
        return f"{value / 10:g} ms"
    if key == "event_timer":
        return f"{value} ms"
    if key == "map":
        return " ".join(map(entry_text, value)) or "-"
    return str(value).lower() if isinstance(value, bool) else str(value)


MAX_PDO_BITS = 64
MAX_ENTRIES = 64
SAM_MPDO = 0xFE
DAM_MPDO = 0xFF
#: Index of a data type usable as a dummy entry -> its length in bits (CiA 301, 7.4.7.1; CiA 306 DummyUsage).
DUMMY_BITS = {0x0001: 1, 0x0002: 8, 0x0003: 16, 0x0004: 32, 0x0005: 8, 0x0006: 16, 0x0007: 32}


@dataclass(frozen=True, slots=True, order=True)
class PdoMappingEntry:
    """A mapped object and its length in *bits* (0..255 as stored; a legal length is 1..64)."""

    index: int
    sub_index: int
    bits: int

    def __post_init__(self) -> None:
        if not (0 <= self.index <= 0xFFFF and 0 <= self.sub_index <= 0xFF and 0 <= self.bits <= 0xFF):
            raise ValueError(f"mapping entry {self.index:X}:{self.sub_index:X}/{self.bits} does not fit its fields")

    @classmethod
    def from_raw(cls, raw: int) -> PdoMappingEntry:
        """Take a 32-bit mapping entry apart: index, sub-index, length in bits."""
        return cls(raw >> 16 & 0xFFFF, raw >> 8 & 0xFF, raw & 0xFF)

    @property
    def raw(self) -> int:
        """The 32-bit word as stored in the device."""
        return self.index << 16 | self.sub_index << 8 | self.bits

    @property
    def is_dummy(self) -> bool:
        """Whether the entry only skips bits (index is a data type, 0x0001..0x0007)."""
        return self.index in DUMMY_BITS and self.sub_index == 0

    @property
    def object(self) -> str:
        """The object as printed and typed: `6C01:01`."""
        return f"{self.index:04X}:{self.sub_index:02X}"

    def __str__(self) -> str:
        return f"{self.object}/{self.bits}"


def total_bits(entries: Iterable[PdoMappingEntry]) -> int:
    """Total length of *entries* in bits."""
    return sum(entry.bits for entry in entries)


def split_dummy(bits: int, usable: Iterable[int]) -> tuple[PdoMappingEntry, ...]:
    """The fewest dummy entries that skip exactly *bits*, from the dummy indices in *usable*.

    Signed dummies are preferred, as in manufacturers' documents. Raises ValueError if the
    usable dummies cannot add up to *bits*.
    """
    sizes: dict[int, int] = {}
    for index in sorted(set(usable) & DUMMY_BITS.keys()):
        sizes.setdefault(DUMMY_BITS[index], index)
    best: dict[int, tuple[PdoMappingEntry, ...]] = {0: ()}
    for length in range(1, bits + 1):
        options = [
            (PdoMappingEntry(index, 0, size), *best[length - size])
            for size, index in sizes.items()
            if length - size in best
        ]
        if options:
            shortest = min(len(option) for option in options)
            chosen = next(option for option in options if len(option) == shortest)
            best[length] = tuple(sorted(chosen, key=lambda entry: -entry.bits))
    if bits not in best:
        have = ", ".join(f"{index:04X}/{size}" for size, index in sorted(sizes.items())) or "none"
        raise ValueError(f"{bits} bits cannot be skipped with the dummies of the device ({have})")
    return best[bits]


#: Scanner lists name what a node sends, dispatcher lists what it takes (CiA 301, 7.5.2.39 and 7.5.2.40).
SCANNER_LISTS, DISPATCHER_LISTS = range(0x1FA0, 0x1FD0), range(0x1FD0, 0x2000)


@dataclass(frozen=True, slots=True)
class ListedObjects:
    """Objects of a list's entry: *count* sub-indices from *index*:*sub_index* of this node on.

    In a dispatcher list they are set by the objects from *source* of the node *node_id* on; both are None in a scanner
    list.
    """

    index: int
    sub_index: int
    count: int = 1
    node_id: int | None = None
    source: tuple[int, int] | None = None

    @property
    def objects(self) -> str:
        """The objects of this node: `2001:01…2001:03`."""
        return _span(self.index, self.sub_index, self.count)

    @property
    def sources(self) -> str:
        """The objects of the other node, empty in a scanner list."""
        return "" if self.source is None else _span(*self.source, self.count)


def _span(index: int, sub_index: int, count: int) -> str:
    first = f"{index:04X}:{sub_index:02X}"
    return first if count <= 1 else f"{first}…{index:04X}:{sub_index + count - 1:02X}"


def listed_objects(index: int, raw: int) -> ListedObjects | None:
    """Return the objects of the entry *raw* of the list at *index*; None for an unused entry, or any other object."""
    if not raw:
        return None
    if index in SCANNER_LISTS:
        return ListedObjects(raw >> 8 & 0xFFFF, raw & 0xFF, raw >> 24 & 0xFF)
    if index in DISPATCHER_LISTS:
        source = (raw >> 16 & 0xFFFF, raw >> 8 & 0xFF)
        return ListedObjects(raw >> 40 & 0xFFFF, raw >> 32 & 0xFF, raw >> 56 & 0xFF, raw & 0xFF, source)
    return None

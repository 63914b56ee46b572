"""A device's object dictionary from a file: names, types, access, limits and defaults."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum, StrEnum
from itertools import takewhile

from dvtcli.domain.can_ids import EMCY_BASE, SDO_REQUEST_BASE, SDO_RESPONSE_BASE, SYNC_ID, TIME_ID
from dvtcli.domain.datatypes import DataType
from dvtcli.domain.objects import COB_ID_EMCY, COB_ID_SYNC, COB_ID_TIME, IDENTITY, SDO_SERVERS


class Access(StrEnum):
    """Access types of CiA 306; `rwr` may feed a TPDO, `rww` may be an RPDO's target."""

    RO = "ro"
    WO = "wo"
    RW = "rw"
    RWR = "rwr"
    RWW = "rww"
    CONST = "const"

    @property
    def readable(self) -> bool:
        """Whether an SDO upload is possible."""
        return self is not Access.WO

    @property
    def writable(self) -> bool:
        """Whether an SDO download is possible."""
        return self not in (Access.RO, Access.CONST)


class ObjectType(IntEnum):
    """Object codes of CiA 301, table 42."""

    NULL = 0
    DOMAIN = 2
    DEFTYPE = 5
    DEFSTRUCT = 6
    VAR = 7
    ARRAY = 8
    RECORD = 9


def standard_default(index: int, sub_index: int, node_id: int) -> int | None:
    """CiA 301's COB-ID for a service of node *node_id* without a value in the file, None if undefined.

    Source: CiA 301, 7.5.2.5 (SYNC), 7.5.2.15 (TIME), 7.5.2.17 (EMCY), 7.5.2.33 and 7.5.2.34 (SDO channels; further
    channels do not exist: bit 31).
    """
    if 0x1201 <= index <= 0x12FF and sub_index in (1, 2):
        return 1 << 31
    server = SDO_SERVERS[0]
    usual = {(COB_ID_SYNC, 0): SYNC_ID, (COB_ID_TIME, 0): TIME_ID, (COB_ID_EMCY, 0): EMCY_BASE + node_id,
             (server, 1): SDO_REQUEST_BASE + node_id, (server, 2): SDO_RESPONSE_BASE + node_id}  # fmt: skip
    return usual.get((index, sub_index))


@dataclass(frozen=True, slots=True)
class OdEntry:
    """A sub-index of an object.

    *data_type* and *pdo_mapping* are None if not in the file. *pdo_mapping* is the
    file's PDOMapping; the direction follows from *access*. *default* and *value* (a DCF's ParameterValue) are the
    bytes for node-ID 0; with *…_relative* the node-ID is added. *low* and *high* are the file's
    limits in the object's own type, for node-ID 0 (`limits` adds it), *unit* and *factor* its texts for them, *offset*
    is added to a raw value before the factor. *line* is its first line in the file, 1 and up.
    *denotation* is its user-given name in this device. *unknown_type* is the code of a data type outside CiA 301.
    """

    index: int
    sub_index: int
    name: str
    data_type: DataType | None = None
    access: Access = Access.RW
    pdo_mapping: bool | None = None
    default: bytes | None = None
    default_relative: bool = False
    value: bytes | None = None
    value_relative: bool = False
    low: int | float | None = None
    high: int | float | None = None
    unit: str = ""
    object_flags: int = 0
    line: int | None = None
    low_relative: bool = False
    high_relative: bool = False
    denotation: str = ""
    unknown_type: int | None = None
    factor: str = ""
    offset: str = ""

    @property
    def object(self) -> str:
        """The object as printed and typed: `6C01:01`."""
        return f"{self.index:04X}:{self.sub_index:02X}"

    @property
    def own_name(self) -> str:
        """The name in the file; empty if it is only the object's number."""
        return "" if self.name in (self.object, f"{self.index:04X}") else self.name

    @property
    def bits(self) -> int | None:
        """Length in bits when mapped, None if unknown or variable."""
        return None if self.data_type is None else self.data_type.bits

    def initial(self, node_id: int) -> bytes | None:
        """Value at power-on of node *node_id*: ParameterValue, else DefaultValue, else None."""
        data, relative = (self.default, self.default_relative)
        if self.value is not None:
            data, relative = self.value, self.value_relative
        if data is None or not relative:
            return data
        modulus = 1 << 8 * len(data)
        return ((int.from_bytes(data, "little") + node_id) % modulus).to_bytes(len(data), "little")

    def at_power_on(self, node_id: int) -> bytes | None:
        """Value at power-on: as `initial`, else the standard's default, else None."""
        data = self.initial(node_id)
        number = None if data is not None else standard_default(self.index, self.sub_index, node_id)
        return data if number is None else number.to_bytes(4, "little")

    def limits(self, node_id: int) -> tuple[int | float | None, int | float | None]:
        """LowLimit and HighLimit on node *node_id*, None if not in the file."""
        low, high = self.low, self.high
        if low is not None and self.low_relative:
            low += node_id
        if high is not None and self.high_relative:
            high += node_id
        return low, high


@dataclass(frozen=True, slots=True)
class OdObject:
    """An index with its entries by sub-index; a VAR has sub-index 0 only.

    *object_flags* belong to an object with sub-indices; other objects have them in their entry.
    """

    index: int
    name: str
    object_type: int
    entries: Mapping[int, OdEntry]
    line: int | None = None
    object_flags: int = 0

    @property
    def own_name(self) -> str:
        """The name in the file; empty if it is only the object's number."""
        return "" if self.name == f"{self.index:04X}" else self.name


@dataclass(frozen=True, slots=True)
class Commissioning:
    """Data of a DCF or XDC about the device's place, apart from its node-ID; None or empty if missing."""

    node_name: str = ""
    bit_rate_kbit: int | None = None
    network_number: int | None = None
    network_name: str = ""
    is_manager: bool | None = None
    lss_serial_number: int | None = None


#: an unset number
ERASED = 0xFFFF_FFFF
#: names looked for in the file's text; more than these make it worth while to build all objects
_FEW_NAMES = 16
_SHORT_WORD = 3


@dataclass(frozen=True, slots=True)
class Modules:
    """Modules of a modular device (CiA 306, 4.8): numbers and names of the *supported* ones, numbers as *connected*."""

    supported: Mapping[int, str] = field(default_factory=dict)
    connected: tuple[int, ...] = ()

    def without_description(self, modules: Collection[int]) -> list[int]:
        """Return those of *modules* that the file does not describe."""
        return sorted(set(modules) - self.supported.keys())

    def unlike(self, attached: Sequence[int] | None, name: str, node_id: int) -> str:
        """Describe how the connected modules differ from those *attached* to a node; empty if they do not.

        *name* begins the sentence, as in `a.dcf has modules`. None: the node does not tell. A file without connected
        modules differs from nothing.
        """
        if attached is None or not self.connected or tuple(attached) == self.connected:
            return ""
        own, its = (", ".join(map(str, numbers)) or "none" for numbers in (self.connected, attached))
        return f"{name} {own}; node {node_id} has {its} (module list, 0x1027)"

    def with_description(self, modules: Sequence[int]) -> tuple[int, ...]:
        """Return *modules* up to the first that the file does not describe: it may shift sub-indices of the others."""
        return tuple(takewhile(self.supported.__contains__, modules))


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """Data of a file about the whole device; None or empty if missing."""

    vendor_name: str = ""
    product_name: str = ""
    vendor_id: int | None = None
    product_code: int | None = None
    revision_number: int | None = None
    granularity: int | None = None
    rpdo_count: int | None = None
    tpdo_count: int | None = None
    node_id: int | None = None
    bit_rates_kbit: tuple[int, ...] = ()
    dummies: frozenset[int] | None = None
    order_code: str = ""
    boot_up_master: bool | None = None
    boot_up_slave: bool | None = None
    dynamic_channels: int | None = None
    group_messaging: bool | None = None
    lss_supported: bool | None = None
    commissioning: Commissioning = Commissioning()
    modules: Modules = Modules()

    @property
    def identity(self) -> dict[str, int | None]:
        """Vendor-ID, product code and revision number; None if missing: 0, or all bits set as in erased memory."""
        numbers = {"vendor": self.vendor_id, "product": self.product_code, "revision": self.revision_number}
        return {name: None if number in (0, ERASED) else number for name, number in numbers.items()}


class ObjectDictionary(Mapping[int, OdObject]):
    """The objects of a file by index, ascending; an object is built at first access.

    *objects* holds OdObjects or functions that build them. *source* is the file's name for messages. *texts* returns
    the text, in lower case, in which the file spells out the names of an index; None if some are made up.
    """

    def __init__(
        self,
        objects: Mapping[int, OdObject | Callable[[], OdObject]],
        info: DeviceInfo | None = None,
        source: str = "",
        texts: Callable[[int], str | None] | None = None,
    ) -> None:
        self._indices = sorted(objects)
        self._objects: dict[int, OdObject | Callable[[], OdObject]] = {i: objects[i] for i in self._indices}
        self.info = info or DeviceInfo()
        self.source = source
        self._texts = texts
        self._found: dict[str, list[OdEntry]] = {}
        self._names: dict[str, list[OdEntry]] | None = None
        self._tells_mappability: bool | None = None

    def __getitem__(self, index: int) -> OdObject:
        found = self._objects[index]
        if not isinstance(found, OdObject):
            found = self._objects[index] = found()
        return found

    def __contains__(self, index: object) -> bool:
        return index in self._objects  # a Mapping's default would build the object

    def __iter__(self) -> Iterator[int]:
        return iter(self._objects)

    def __len__(self) -> int:
        return len(self._objects)

    def indices_among(self, indices: range) -> list[int]:
        """Existing indices within *indices* (without gaps), ascending."""
        return self._indices[bisect_left(self._indices, indices.start) : bisect_left(self._indices, indices.stop)]

    def entry(self, index: int, sub_index: int) -> OdEntry | None:
        """The entry at *index*:*sub_index*, or None."""
        found = self._objects.get(index)
        if found is None:
            return None
        if not isinstance(found, OdObject):
            found = self[index]
        return found.entries.get(sub_index)

    def entries(self) -> Iterator[OdEntry]:
        """Every entry, ascending by index and sub-index."""
        for index in self:
            yield from self[index].entries.values()

    def without(self, absent: Collection[tuple[int, int]]) -> ObjectDictionary:
        """The same dictionary without the objects at *absent*; sub-index 0 there means the whole object."""
        if not absent:
            return self
        objects = {index: held for index, held in self._objects.items() if (index, 0) not in absent}
        for index in {index for index, _ in absent} & objects.keys():
            held = self[index]
            left = {sub: entry for sub, entry in held.entries.items() if (index, sub) not in absent}
            objects[index] = replace(held, entries=left)
        return ObjectDictionary(objects, self.info, self.source, self._texts)

    def identified(self) -> ObjectDictionary:
        """The same dictionary with a complete identity: values missing or 0 in 0x1018 come from the device's data."""
        if IDENTITY not in self:
            return self
        held = self[IDENTITY]
        entries = dict(held.entries)
        for sub_index, number in enumerate(self.info.identity.values(), 1):
            entry = entries.get(sub_index)
            if entry is not None and number and not any(entry.initial(0) or b""):
                entries[sub_index] = replace(entry, default=number.to_bytes(4, "little"), value=None)
        if entries == dict(held.entries):
            return self
        objects = {**self._objects, IDENTITY: replace(held, entries=entries)}
        return ObjectDictionary(objects, self.info, self.source, self._texts)

    @property
    def tells_mappability(self) -> bool:
        """Whether the file has any PDOMapping; otherwise mappability is unknown, not refused."""
        if self._tells_mappability is None:
            self._tells_mappability = any(entry.pdo_mapping is not None for entry in self.entries())
        return self._tells_mappability

    def place(self, entry: OdEntry) -> str:
        """Place of *entry* in the file: `drive.eds:812`."""
        return f"{self.source}:{entry.line}" if entry.line else self.source

    def display_name(self, index: int, sub_index: int) -> str:
        """A name for people: the entry's own, with its object's in front if several entries share it.

        A user-given name in this device precedes it: `Tank left (Analogue input.Channel 1)`.
        """
        entry = self.entry(index, sub_index)
        if entry is None:
            return ""
        parent = self[index].name
        name = entry.name if len(self[index].entries) == 1 or entry.name == parent else f"{parent}.{entry.name}"
        called = " ".join(entry.denotation.split())
        return f"{called} ({name})" if called and called != name else name

    def find(self, name: str) -> list[OdEntry]:
        """Entries that match *name*, regardless of case, blanks and punctuation.

        `statusword`, `Velocity actual value`, `velocity_actual_value` and `Analogue input.Channel 1` are all found.
        A full `object.entry` name is tried first, then an entry's or a one-entry object's own name, and the
        entry's user-given name in this device.
        """
        wanted = normalised(name)
        if self._names is None and self._texts is not None and len(self._found) < _FEW_NAMES:
            if wanted not in self._found:
                self._found[wanted] = self._by_name(self._indices_that_spell(wanted)).get(wanted, [])
            return self._found[wanted]
        if self._names is None:
            self._names = self._by_name(self)
        return self._names.get(wanted, [])

    def _indices_that_spell(self, wanted: str) -> list[int]:
        """The indices that may have the name *wanted*: the text of the others in the file lacks its longest word."""
        word = max(re.findall("[a-zà-ÿ]+", wanted), key=len, default="")
        if len(word) < _SHORT_WORD or self._texts is None or not word.strip("abcdef"):  # an index may be the name
            return self._indices
        texts = ((index, self._texts(index)) for index in self._indices)
        return [index for index, text in texts if text is None or word in text]

    def _by_name(self, indices: Iterable[int]) -> dict[str, list[OdEntry]]:
        names: dict[str, list[OdEntry]] = {}
        for entry in (entry for index in indices for entry in self[index].entries.values()):
            parent = self[entry.index].name
            keys = {normalised(entry.name), normalised(f"{parent}.{entry.name}"), normalised(entry.denotation)}
            keys.add(normalised(self.display_name(entry.index, entry.sub_index)))
            if len(self[entry.index].entries) == 1:
                keys.add(normalised(parent))
            for key in keys - {""}:
                names.setdefault(key, []).append(entry)
        return names


_SEPARATOR = re.compile(r"[^0-9a-zà-ÿ.]+")


def normalised(name: str) -> str:
    """*name* in lower case with every run of blanks and punctuation (but `.`) as `_`."""
    return _SEPARATOR.sub("_", name.lower()).strip("_")

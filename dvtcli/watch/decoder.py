"""Frames and the signals in them: a decoder made from PDO configurations, and whether a frame fits its layout."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from dvtcli.domain.cob_id import SRDO_COB_IDS, SRDO_DIRECTION, CobId
from dvtcli.domain.datatypes import DataType, Value
from dvtcli.domain.frame import byte_length, values_reader
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.object_scalings import NOTHING, ObjectScalings
from dvtcli.domain.objects import FURTHER_SDO_SERVERS, SDO_SERVERS, SRDO_COMMUNICATION
from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry
from dvtcli.domain.ports import Frame
from dvtcli.domain.profile import ObjectAddress
from dvtcli.domain.scaling import Scaling
from dvtcli.domain.text import plural
from dvtcli.watch.service import Service, service_of

#: A frame's identity on the bus: CAN-ID and whether it has 29 bits.
Address = tuple[int, bool]


@dataclass(frozen=True, slots=True)
class SignalPlace:
    """Place of a signal in a DBC file: *bits* bits from *start_bit* on, counted from the lowest bit in byte 0.

    *start_bit* is the least significant bit; with *is_big_endian* the most significant bit, and the others follow
    downwards in this byte, then from bit 7 in the next byte, as in DBC files.
    """

    start_bit: int
    bits: int
    is_big_endian: bool = False


@dataclass(frozen=True, slots=True)
class Signal:
    """A value in a frame: *object* is `606C:00`, empty if a file gave only names; *key* is unique in the frame.

    *meaning* is the scaling, *bits* the length, 0 if unknown; *data_type* is None if unknown.
    *place* is the place according to a DBC file; None if from a PDO's mapping.
    """

    key: str
    name: str = ""
    object: str = ""
    meaning: Scaling = NOTHING
    bits: int = 0
    data_type: DataType | None = None
    place: SignalPlace | None = None

    @property
    def unit(self) -> str:
        """The physical unit, empty for none."""
        return self.meaning.unit


@dataclass(frozen=True, slots=True)
class Layout:
    """Contents of a frame: *read* turns data into a value per signal, None if the frame ends before.

    *mapping* is the PDO's, dummies included; empty if a file gives the signals' places. *is_consumers*: only the part
    that an RPDO receives. *byte_length* is the required length according to *source*, in words (`the mapping in
    gen4.eds`); None if unknown. *guess* names the origin of a mapping taken from elsewhere and not from this very node;
    empty otherwise. *mpdo* is the count of a multiplexed PDO, whose frames name their objects themselves.
    """

    service: Service
    signals: tuple[Signal, ...]
    read: Callable[[bytes], list[Value | None]]
    mapping: tuple[PdoMappingEntry, ...] = ()
    is_consumers: bool = False
    byte_length: int | None = None
    source: str = ""
    guess: str = ""
    mpdo: int | None = None
    #: the signals' keys in their order, and constant data by key: meaning and object
    keys: tuple[str, ...] = field(init=False, repr=False, compare=False)
    scalings: Mapping[str, Scaling] = field(init=False, repr=False, compare=False)
    #: the PDO in small letters, None unless its mapping is known
    pdo: str | None = field(init=False, repr=False, compare=False)
    objects: Mapping[str, str] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        scalings = {signal.key: signal.meaning for signal in self.signals if signal.meaning.says}
        objects = {signal.key: signal.object for signal in self.signals if signal.object}
        service = self.service
        is_known = service.kind == "pdo" and not service.label.endswith("?")
        object.__setattr__(self, "keys", tuple(signal.key for signal in self.signals))
        object.__setattr__(self, "pdo", service.label.lower() if is_known else None)
        object.__setattr__(self, "scalings", scalings)
        object.__setattr__(self, "objects", objects)

    def values(self, frame: Frame) -> dict[str, Value]:
        """Signals completely in *frame*, by key."""
        if frame.remote or not self.signals:
            return {}
        return {key: value for key, value in zip(self.keys, self.read(frame.data), strict=True) if value is not None}


def no_values(_data: bytes) -> list[Value | None]:
    """Read no value: the layout of a frame without signals."""
    return []


class Decoder:
    """Decode frames by their address; unknown frames by the pre-defined connection set.

    *names* are node names, by node-ID; *called* are those that the user gave, in a network file. *identities* are the
    0x1018 values of nodes in the sources of the layouts.
    """

    def __init__(
        self,
        layouts: Mapping[Address, Layout] | None = None,
        names: Mapping[int, str] | None = None,
        called: Mapping[int, str] | None = None,
    ) -> None:
        self._known = dict(layouts or {})
        self.called = dict(called or {})
        self.names = dict(names or {}) | self.called
        self.identities: dict[int, Mapping[str, int | None]] = {}
        #: layouts by the pre-defined connection set
        self._by_default: dict[Address, Layout] = {}

    def __len__(self) -> int:
        return len(self._known)

    def add(self, layouts: Mapping[Address, Layout]) -> None:
        """Add *layouts*; known layouts stay, but an RPDO's layout gives way to its TPDO's.

        A guess gives way to any certain layout.
        """
        for address, layout in layouts.items():
            known = self._known.get(address)
            if (
                known is None
                or (known.is_consumers and not layout.is_consumers)
                or (bool(known.guess) and not layout.guess)
            ):
                self._known[address] = layout

    @property
    def layouts(self) -> Mapping[Address, Layout]:
        """All layouts added, guesses included."""
        return self._known

    def layout(self, frame: Frame) -> Layout:
        """Layout of *frame*; without signals if unknown."""
        address = frame.can_id, frame.extended
        found = self._known.get(address) or self._by_default.get(address)
        if found is None:
            found = Layout(service_of(frame.can_id, extended=frame.extended), (), no_values)
            self._by_default[address] = found
        return found

    def values(self, frame: Frame) -> dict[str, Value]:
        """Signals completely in *frame*, by key."""
        return self.layout(frame).values(frame)


#: signals of a mapping, and the function that reads their values
SignalsOfMappings = dict[tuple[PdoMappingEntry, ...], tuple[tuple[Signal, ...], Callable[[bytes], list[Value | None]]]]


def pdo_layouts(
    node_id: int,
    configs: Mapping[Pdo, PdoConfig],
    dictionary: ObjectDictionary | None,
    scalings: ObjectScalings,
    source: str = "",
    known: SignalsOfMappings | None = None,
) -> dict[Address, Layout]:
    """Layouts of a node's enabled PDOs; a TPDO takes precedence over an RPDO with the same COB-ID.

    *scalings* gives the scaling of objects, *source* the origin of the mapping in words. *known* keeps the signals of
    mappings from call to call, for nodes with the same *dictionary* and *scalings*.
    """
    known = {} if known is None else known
    layouts: dict[Address, Layout] = {}
    for pdo, config in sorted(configs.items(), key=lambda item: not item[0].is_tpdo):
        if config.enabled:
            cob_id = config.communication.cob_id
            service = Service("pdo", pdo.label, node_id)
            bits = sum(entry.bits for entry in config.mapping)
            if config.mapping not in known:
                known[config.mapping] = _signals(config.mapping, dictionary, scalings)
            signals, read = known[config.mapping]
            layout = Layout(
                service, signals, read, config.mapping, is_consumers=not pdo.is_tpdo, source=source,
                byte_length=byte_length(bits) if config.mpdo is None else None, mpdo=config.mpdo,
            )  # fmt: skip
            layouts.setdefault((cob_id.can_id, cob_id.extended), layout)
    return layouts


def _signals(
    mapping: tuple[PdoMappingEntry, ...], dictionary: ObjectDictionary | None, scalings: ObjectScalings
) -> tuple[tuple[Signal, ...], Callable[[bytes], list[Value | None]]]:
    """The signals of *mapping*, and what reads their values."""
    types: dict[PdoMappingEntry, DataType | None] = {}
    signals: list[Signal] = []
    for entry in mapping:
        known = dictionary.entry(entry.index, entry.sub_index) if dictionary else None
        types[entry] = known.data_type if known else None
        if not entry.is_dummy:
            name = dictionary.display_name(entry.index, entry.sub_index) if dictionary else ""
            meaning = scalings.of(entry.index, entry.sub_index)
            signals.append(Signal(name or entry.object, name, entry.object, meaning, entry.bits, types[entry]))

    return tuple(unique(signals)), values_reader(mapping, types.get)


def unique(signals: Iterable[Signal]) -> list[Signal]:
    """*signals* with distinct keys, even if an object is mapped twice or two objects share a name."""
    found: list[Signal] = []
    taken: set[str] = set()
    for signal in signals:
        key, number = signal.key, 1
        if key in taken and signal.object:
            key = f"{signal.key} ({signal.object})"
        base = key
        while key in taken:
            number += 1
            key = f"{base} #{number}"
        taken.add(key)
        found.append(signal if key == signal.key else replace(signal, key=key))
    return found


def guess(frame: Frame, layout: Layout) -> str:
    """Note for a *frame* with values by a guessed *layout*, in words; empty otherwise."""
    return f"{_cob_id(frame)}: {layout.guess}" if layout.guess and layout.signals and not frame.remote else ""


def _cob_id(frame: Frame) -> str:
    return f"0x{frame.can_id:0{8 if frame.extended else 3}X}"


def doubts(frame: Frame, layout: Layout) -> list[str]:
    """Reasons to doubt values of *frame* by *layout*, in words: a guess, or a misfit."""
    return [text for text in (guess(frame, layout), misfit(frame, layout)) if text]


def misfit(frame: Frame, layout: Layout) -> str:
    """Mismatch between the lengths of *frame* and *layout*, in words; empty if they fit.

    A TPDO is sent as long as it is mapped. A node takes the front of a frame longer than its RPDO, and nothing
    of a shorter frame (CiA 301, 7.4.7).
    """
    length, mapped = len(frame.data), layout.byte_length
    if frame.remote or mapped is None or not layout.signals or length == mapped:
        return ""
    if layout.is_consumers and length > mapped:
        return ""
    who = f"{layout.service.label} of node {layout.service.node}" if layout.service.node else layout.service.label
    by = layout.source or "its mapping"
    said = f"{_cob_id(frame)}: the frame has {plural(length, 'byte')}, {by} has {mapped} for {who}"
    if layout.is_consumers:
        return f"{said}: a node ignores frames shorter than its RPDO, or this is not its mapping"
    return f"{said}: this is not the producer's layout, so the values shown may be wrong"


class Misfits:
    """Reports frames to *tell* if *layout_of* is a guess or does not fit, each once for each CAN-ID."""

    def __init__(self, layout_of: Callable[[Frame], Layout], tell: Callable[[str], None]) -> None:
        self._layout_of = layout_of
        self._tell = tell
        #: the last checked length, by address; None after a report
        self._seen: dict[Address, int | None] = {}

    def look(self, frame: Frame) -> None:
        """Check *frame*; cheap if its length is unchanged."""
        address, length = (frame.can_id, frame.extended), len(frame.data)
        seen = self._seen.get(address, -1)
        if seen == length or seen is None or frame.remote:
            return
        layout = self._layout_of(frame)
        if seen == -1 and (guessed := guess(frame, layout)):
            self._tell(guessed)
        text = misfit(frame, layout)
        self._seen[address] = None if text else length
        if text:
            self._tell(text)

    def passing(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Yield *frames* after a check of each."""
        for frame in frames:
            self.look(frame)
            yield frame


#: by sub-index of an SDO server: the COB-ID to the server, and that from it
_WORDS = {1: "request", 2: "answer"}


def server_layouts(node_id: int, numbers: Mapping[ObjectAddress, int]) -> dict[Address, Layout]:
    """Return a layout for each CAN-ID of the SDO servers of *node_id*: `SDO2 request` and `SDO2 answer` of 0x1201.

    *numbers* are values of its objects; a disabled COB-ID has no layout.
    """
    found: dict[Address, Layout] = {}
    for (index, sub_index), raw in numbers.items():
        cob_id = CobId.from_raw(raw)
        if index in SDO_SERVERS and sub_index in _WORDS and cob_id.valid and cob_id.can_id:
            label = f"{server_name(index)} {_WORDS[sub_index]}"
            found[cob_id.can_id, cob_id.extended] = Layout(Service("sdo", label, node_id), (), no_values)
    return found


def server_name(index: int) -> str:
    """Name the SDO server at *index*: `SDO` is the default one, `SDO2` that of 0x1201."""
    number = index - SDO_SERVERS[0] + 1
    return "SDO" if number == 1 else f"SDO{number}"


def srdo_name(index: int, sub_index: int) -> str:
    """Name the frame whose COB-ID is at *index*:*sub_index*: `SRDO1`, or `SRDO1 inverted` for its second frame."""
    return f"SRDO{index - SRDO_COMMUNICATION.start + 1}{'' if sub_index == SRDO_COB_IDS[0] else ' inverted'}"


def described_channels(
    node_id: int, dictionary: ObjectDictionary | None, written: Mapping[ObjectAddress, int] | None = None
) -> dict[Address, Layout]:
    """Return layouts of further SDO servers and SRDOs by the values in *dictionary*, and by those *written* instead."""
    said = dict(written or {})
    srdos: dict[Address, Layout] = {}
    if dictionary is not None:
        servers = [(index, sub) for index in dictionary.indices_among(FURTHER_SDO_SERVERS) for sub in _WORDS]
        parts = (SRDO_DIRECTION, *SRDO_COB_IDS)
        channels = [(index, sub) for index in dictionary.indices_among(SRDO_COMMUNICATION) for sub in parts]
        described = {place: _initial(dictionary, place, node_id) for place in (*servers, *channels)}
        said = {place: raw for place, raw in described.items() if raw is not None} | said
        for index, sub_index in channels:
            if sub_index in SRDO_COB_IDS and said.get((index, SRDO_DIRECTION)) and (index, sub_index) in said:
                service = Service("other", srdo_name(index, sub_index), node_id)
                srdos[said[index, sub_index], False] = Layout(service, (), no_values)
    return srdos | server_layouts(node_id, said)


def _initial(dictionary: ObjectDictionary, place: ObjectAddress, node_id: int) -> int | None:
    entry = dictionary.entry(*place)
    data = None if entry is None else entry.initial(node_id)
    return None if data is None else int.from_bytes(data, "little")

"""Frames and the signals in them: a decoder made from PDO configurations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

from dvtcli.domain.datatypes import DataType, Value
from dvtcli.domain.frame import byte_length, values_reader
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.object_scalings import NOTHING, ObjectScalings
from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry
from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling
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
        self._guessed: dict[Address, Layout] = {}

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
        """All layouts known for certain."""
        return self._known

    def layout(self, frame: Frame) -> Layout:
        """Layout of *frame*; without signals if unknown."""
        address = frame.can_id, frame.extended
        found = self._known.get(address) or self._guessed.get(address)
        if found is None:
            found = Layout(service_of(frame.can_id, extended=frame.extended), (), no_values)
            self._guessed[address] = found
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

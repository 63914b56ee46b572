"""Frames and the signals in them: a decoder made from PDO configurations.

Does not know where configurations come from (a node, a DCF), nor how signals are shown.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

from dvtcli.domain.datatypes import DataType, Value
from dvtcli.domain.frame import byte_length, values_reader
from dvtcli.domain.mapping import PdoMappingEntry
from dvtcli.domain.meanings import NOTHING, Meanings
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling
from dvtcli.watch.service import Service, service_of

#: A frame's identity on the bus: CAN-ID and whether it has 29 bits.
Address = tuple[int, bool]


@dataclass(frozen=True, slots=True)
class SignalPlace:
    """Where a signal of a DBC file lies: *bits* bits from *start_bit* on, counted from the lowest bit of byte 0.

    *start_bit* is its least significant bit; with *is_big_endian* its most significant one, and the others follow
    downwards in that byte, then from bit 7 of the next one, as DBC files have it.
    """

    start_bit: int
    bits: int
    is_big_endian: bool = False


@dataclass(frozen=True, slots=True)
class Signal:
    """One value in a frame: *object* is `606C:00`, empty where a file gave names only; *key* is unique in its frame.

    *meaning* is what its raw value means, *bits* how long that is, 0 where nobody knows; *data_type* None likewise.
    *place* is where it lies by a DBC file; None if the mapping of a PDO says it.
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
        """The physical unit, empty where it has none."""
        return self.meaning.unit


@dataclass(frozen=True, slots=True)
class Layout:
    """What a frame carries: *read* turns its data into one value a signal, None where the frame ends before it.

    *mapping* is the PDO's, dummies included; empty where a file says where its signals lie. With *is_consumers* it is
    what an RPDO takes from the frame, which may be less than its producer sends. *byte_length* is how long the frame
    has to be by *source*, the words for who says so (`the mapping in gen4.eds`); None where nobody does. *guess* says
    that nobody said this mapping of this very node, and whose is taken instead; empty where somebody did.
    """

    service: Service
    signals: tuple[Signal, ...]
    read: Callable[[bytes], list[Value | None]]
    mapping: tuple[PdoMappingEntry, ...] = ()
    is_consumers: bool = False
    byte_length: int | None = None
    source: str = ""
    guess: str = ""
    #: what is the same for each frame, by the keys of its signals: what values mean, which objects they are
    meanings: Mapping[str, Scaling] = field(init=False, repr=False, compare=False)
    objects: Mapping[str, str] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        meanings = {signal.key: signal.meaning for signal in self.signals if signal.meaning.says}
        objects = {signal.key: signal.object for signal in self.signals if signal.object}
        object.__setattr__(self, "meanings", meanings)
        object.__setattr__(self, "objects", objects)

    def values(self, frame: Frame) -> dict[str, Value]:
        """The signals of *frame* that lie in it completely, by their keys."""
        if frame.remote or not self.signals:
            return {}
        return {
            signal.key: value
            for signal, value in zip(self.signals, self.read(frame.data), strict=True)
            if value is not None
        }


def _nothing(_data: bytes) -> list[Value | None]:
    return []


class Decoder:
    """Knows frames by their address; what it does not know is told by the pre-defined connection set.

    *names* are those of nodes, by node-ID; *identities* what 0x1018 of nodes is by what the layouts are from.
    """

    def __init__(self, layouts: Mapping[Address, Layout] | None = None, names: Mapping[int, str] | None = None) -> None:
        self._known = dict(layouts or {})
        self.names = dict(names or {})
        self.identities: dict[int, Mapping[str, int | None]] = {}
        self._guessed: dict[Address, Layout] = {}

    def __len__(self) -> int:
        return len(self._known)

    def add(self, layouts: Mapping[Address, Layout]) -> None:
        """Know *layouts* too; what was known before stays, but what an RPDO takes of a frame yields to its TPDO.

        A guess yields to what anybody says.
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
        """All that is known for certain."""
        return self._known

    def layout(self, frame: Frame) -> Layout:
        """What *frame* carries; a layout without signals where nothing is known of it."""
        address = frame.can_id, frame.extended
        found = self._known.get(address) or self._guessed.get(address)
        if found is None:
            found = Layout(service_of(frame.can_id, extended=frame.extended), (), _nothing)
            self._guessed[address] = found
        return found

    def values(self, frame: Frame) -> dict[str, Value]:
        """The signals of *frame* that lie in it completely, by their keys."""
        return self.layout(frame).values(frame)


def pdo_layouts(
    node_id: int,
    configs: Mapping[Pdo, PdoConfig],
    dictionary: ObjectDictionary | None,
    meanings: Meanings,
    source: str = "",
) -> dict[Address, Layout]:
    """The layouts of a node's enabled PDOs; where a TPDO and an RPDO share a COB-ID, the TPDO's counts.

    *meanings* says what their objects' values mean, *source* in words where the mapping is from.
    """
    layouts: dict[Address, Layout] = {}
    for pdo, config in sorted(configs.items(), key=lambda item: not item[0].is_tpdo):
        if config.enabled:
            cob_id = config.communication.cob_id
            service = Service("pdo", pdo.label, node_id)
            bits = sum(entry.bits for entry in config.mapping)
            layout = replace(
                _layout(service, config.mapping, dictionary, meanings), is_consumers=not pdo.is_tpdo, source=source,
                byte_length=byte_length(bits) if config.mpdo is None else None,
            )  # fmt: skip
            layouts.setdefault((cob_id.can_id, cob_id.extended), layout)
    return layouts


def _layout(
    service: Service, mapping: tuple[PdoMappingEntry, ...], dictionary: ObjectDictionary | None, meanings: Meanings
) -> Layout:
    types: dict[PdoMappingEntry, DataType | None] = {}
    signals: list[Signal] = []
    for entry in mapping:
        known = dictionary.entry(entry.index, entry.sub_index) if dictionary else None
        types[entry] = known.data_type if known else None
        if not entry.is_dummy:
            name = dictionary.display_name(entry.index, entry.sub_index) if dictionary else ""
            meaning = meanings.of(entry.index, entry.sub_index)
            signals.append(Signal(name or entry.object, name, entry.object, meaning, entry.bits, types[entry]))

    return Layout(service, tuple(unique(signals)), values_reader(mapping, types.get), mapping)


def unique(signals: Iterable[Signal]) -> list[Signal]:
    """*signals* with keys that differ, also where an object is mapped twice or two objects share a name."""
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
        found.append(replace(signal, key=key))
    return found

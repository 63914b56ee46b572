"""Import what a CANopen manager downloads (CiA 302-3, 0x1F22) as a network file.

Reads the manager, and the identity of its nodes if they answer, to find their EDS. Writes nothing to a node.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_identity
from dvtcli.device.store.store_parameters import SIGNATURES
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.datatypes import CanopenTime, DataType, Kind
from dvtcli.domain.network.concise_dcf import BEFORE_PDOS, ConciseEntry, concise_entries
from dvtcli.domain.network.network_config import (
    ExpectedIdentity,
    FileWord,
    HeartbeatWatch,
    NodeConfig,
    ObjectConfig,
    PartialPdoConfig,
    ValueConfig,
)
from dvtcli.domain.objects import (
    CONCISE_DCF,
    CONSUMER_HEARTBEAT,
    ERROR_BEHAVIOUR,
    EXPECTED_PRODUCT,
    EXPECTED_VENDOR,
    VERIFY_CONFIGURATION,
)
from dvtcli.domain.pdo import MAX_ENTRIES, MAX_PDO_BITS, Pdo, PdoMappingEntry
from dvtcli.domain.profile import ObjectAddress
from dvtcli.domain.text import all_nodes
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError, UsageError
from dvtcli.files.network.network_keys import OF, Where
from dvtcli.files.profiles import profile_for_identity, profile_of
from dvtcli.operations.exchange.export_network import (
    Exported,
    FoundNode,
    NamedNode,
    eds_word,
    mapped_word,
    network_place,
    title_word,
    write_found,
)
from dvtcli.operations.network.concise_network import no_manager
from dvtcli.operations.network.described_network import simulated_word
from dvtcli.operations.session.save_script import ask_before_overwriting
from dvtcli.operations.session.simulated_nodes import file_or_family, read_dictionary

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


#: lengths (bytes) for which an object without type is unsigned: UNSIGNED8 to UNSIGNED64
_OBVIOUS = (1, 2, 4, 8)


def value_word(dictionary: ObjectDictionary | None, place: tuple[int, int], data: bytes) -> tuple[str | None, str]:
    """Return *data* as a value for `sdo:`; None with the reason if it cannot be written so."""
    entry = None if dictionary is None else dictionary.entry(*place)
    kind = None if entry is None else entry.data_type
    size = f"{len(data)} byte{'' if len(data) == 1 else 's'}"
    if kind is None:
        if len(data) in _OBVIOUS:
            return f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}", ""
        return None, f"{size}, and no EDS defines its type"
    try:
        text = _text(kind, data)
        if kind.parse(text) == data:
            return text, ""
    except ValueError:
        pass
    return None, f"{size}, which does not fit {kind.name}"


def _text(kind: DataType, data: bytes) -> str:
    value = kind.decode(data)
    if isinstance(value, CanopenTime):
        return f"{value.days}:{value.milliseconds}"
    if isinstance(value, bytes):
        return value.hex().upper()
    if kind.kind is Kind.UNSIGNED and kind.bits == 32:
        return f"0x{value:X}"
    return str(int(value)) if isinstance(value, bool) else str(value)


@dataclass(slots=True)
class _Left:
    """Downloads to a node in order, removed when converted. *unsaid*: those that cannot be, with reasons."""

    data: dict[ObjectAddress, bytes]
    unsaid: dict[ObjectAddress, str] = field(default_factory=dict)

    def number(self, index: int, sub_index: int, size: int) -> int | None:
        """Remove and return a number of *size* bytes; None if not downloaded or of another size."""
        data = self.data.get((index, sub_index))
        if data is None or len(data) != size:
            return None
        del self.data[index, sub_index]
        return int.from_bytes(data, "little")


def node_from_frames(device: NamedNode, downloads: Sequence[ConciseEntry]) -> tuple[Exported, tuple[str, ...]]:
    """Convert *downloads* to *device*, in their order; also returns what a file cannot have.

    A stamp (0x1020) becomes `stamp: true`, computed by the file. A file has a single value per object: the last of
    several downloads counts, and the others are reported.
    """
    left = _Left({(download.index, download.sub_index): download.data for download in downloads})
    remarks: dict[str, str] = {}
    stamped = {left.data.pop((VERIFY_CONFIGURATION, sub_index), None) for sub_index in (1, 2)} != {None}
    pdos = sorted({pdo for index, _ in left.data if (pdo := Pdo.at(index)) is not None}, key=_order)
    options = tuple(_pdo(device, pdo, left, remarks) for pdo in pdos)
    watches = _watches(left)
    config = NodeConfig(
        title_word(device), device.node_id,
        pdos=tuple(pdo_config for pdo_config in options if pdo_config != PartialPdoConfig(pdo_config.pdo)),
        objects=tuple(_objects(left)), values=tuple(_values(device, left, remarks)), watches=watches,
        store=True if stamped else None, stamp=True if stamped else None,
    )  # fmt: skip
    left.unsaid |= dict.fromkeys(left.data, "it has no key in a network file")
    left.unsaid = _repeated(downloads) | left.unsaid
    unsaid = tuple(f"{index:04X}:{sub_index:02X} ({why})" for (index, sub_index), why in sorted(left.unsaid.items()))
    own = {(device.node_id, word): text for word, text in remarks.items()}
    return Exported(config, own, tuple(text.partition(" ")[0] for text in unsaid)), unsaid


def _repeated(downloads: Sequence[ConciseEntry]) -> dict[ObjectAddress, str]:
    """Report repeated downloads, as for unlocking: each may have an effect, and a file has only the last.

    Excluded are PDOs, which are disabled while being set, and a stamp.
    """
    counts = Counter((download.index, download.sub_index) for download in downloads)
    return {
        place: f"downloaded {count} times, the file has the last"
        for place, count in counts.items()
        if count > 1 and place[0] != VERIFY_CONFIGURATION and Pdo.at(place[0]) is None
    }


def _order(pdo: Pdo) -> tuple[bool, int]:
    return (not pdo.is_tpdo, pdo.number)


def _pdo(device: NamedNode, pdo: Pdo, left: _Left, remarks: dict[str, str]) -> PartialPdoConfig:
    at = pdo.communication_index
    raw = left.number(at, 1, 4)
    cob_id = None if raw is None else CobId.from_raw(raw)
    if cob_id is not None and cob_id.valid and not cob_id.can_id:
        left.unsaid[at, 1] = f"0x{raw:08X}: a PDO that is on has no CAN-ID 0"
        cob_id = None
    named = cob_id is not None and bool(cob_id.can_id)  # a COB-ID of 0 that is off is no CAN-ID
    return PartialPdoConfig(
        pdo,
        enabled=None if cob_id is None else cob_id.valid,
        cob_id=cob_id.can_id if cob_id is not None and named else None,
        extended=cob_id is not None and named and cob_id.extended,
        rtr_allowed=None if cob_id is None else cob_id.rtr_allowed,
        transmission_type=left.number(at, 2, 1),
        inhibit_time=left.number(at, 3, 2) if pdo.is_tpdo else None,
        event_timer=left.number(at, 5, 2),
        sync_start_value=left.number(at, 6, 1) if pdo.is_tpdo else None,
        mapping=_mapping(device, pdo, left, remarks),
    )


def _mapping(device: NamedNode, pdo: Pdo, left: _Left, remarks: dict[str, str]) -> tuple[FileWord, ...] | None:
    """Convert the mapping; None if incomplete or impossible in a file."""
    at = pdo.mapping_index
    count = left.data.get((at, 0))
    if count is None or len(count) != 1 or count[0] > MAX_ENTRIES:
        return None
    raws = [left.data.get((at, sub_index), b"") for sub_index in range(1, count[0] + 1)]
    entries = [PdoMappingEntry.from_raw(int.from_bytes(raw, "little")) for raw in raws if len(raw) == 4]
    if len(entries) != count[0] or not all(1 <= entry.bits <= MAX_PDO_BITS for entry in entries):
        return None
    for sub_index in range(count[0] + 1):
        del left.data[at, sub_index]
    return tuple(mapped_word(device, entry, remarks) for entry in entries)


def _watches(left: _Left) -> tuple[HeartbeatWatch, ...]:
    """Convert the entries of 0x1016 if they are the first downloads and as `heartbeat_consumer` would write them.

    The entries must begin at sub-index 1, ordered by producer. Others stay values.
    """
    places = [place for place in left.data if place[0] == CONSUMER_HEARTBEAT]
    first = list(left.data)[: len(places)]
    numbers = [int.from_bytes(left.data[place], "little") for place in places]
    producers = [number >> 16 for number in numbers]
    in_order = [sub_index for _, sub_index in places] == list(range(1, len(places) + 1)) and first == places
    if not in_order or producers != sorted({producer for producer in producers if 1 <= producer <= 127}):
        return ()
    if not all(number & 0xFFFF for number in numbers):
        return ()
    for place in places:
        del left.data[place]
    return tuple(HeartbeatWatch(number >> 16, number & 0xFFFF) for number in numbers)


def _objects(left: _Left) -> list[ObjectConfig]:
    """Convert objects with keys: the first behind the PDOs, as far as ordered like a file."""
    keys = {key.object[:2]: (key.name, key.object[2]) for key in OF[Where.NODE].values() if key.object is not None}
    found: list[ObjectConfig] = []
    for place in [place for place in left.data if Pdo.at(place[0]) is None]:
        name, size = ("error_behavior", 1) if place[0] == ERROR_BEHAVIOUR and place[1] else keys.get(place, ("", 0))
        is_next = place[0] in BEFORE_PDOS or all(
            config.index < place[0] for config in found if config.index not in BEFORE_PDOS
        )
        if len(left.data[place]) != size or not is_next:
            break
        found.append(ObjectConfig(name, *place, left.data.pop(place)))
    return sorted(found, key=lambda entry: (entry.index, entry.sub_index))


def _values(device: NamedNode, left: _Left, remarks: dict[str, str]) -> list[ValueConfig]:
    """Convert the rest, besides PDOs, to `sdo:`."""
    found: list[ValueConfig] = []
    for place in [place for place in left.data if Pdo.at(place[0]) is None]:
        data, word = left.data.pop(place), f"{place[0]:04X}:{place[1]:02X}"
        if place[0] in SIGNATURES:
            left.unsaid[place] = "a command"
            continue
        text, why = value_word(device.dictionary, place, data)
        if text is None:
            left.unsaid[place] = why
            continue
        if device.dictionary is not None:
            remarks[word] = device.dictionary.display_name(*place)
        found.append(ValueConfig(FileWord(word), FileWord(text)))
    return found


#: a manager's expected vendor-ID and product code of each node (CiA 302-3)
_EXPECTED = (EXPECTED_VENDOR, EXPECTED_PRODUCT)


@dataclass(frozen=True, slots=True)
class _Booted:
    """A node that a manager boots, as far as known."""

    node_id: int
    identity: ExpectedIdentity
    eds: Path | None

    @property
    def dictionary(self) -> ObjectDictionary | None:
        """The dictionary of its EDS."""
        return None if self.eds is None else read_dictionary(self.eds)

    @property
    def profile(self) -> DeviceProfile:
        """The profile of its identity, else of its EDS."""
        if self.identity.vendor:
            return profile_for_identity(self.identity.vendor, self.identity.product or 0)
        return profile_of(self.dictionary)

    @property
    def title(self) -> str:
        """The name in its EDS."""
        return "" if self.dictionary is None else self.dictionary.info.product_name


def import_manager(session: SessionNodes, file: str, manager: int) -> Facts:
    """Import what the manager *manager* downloads to its nodes, or those of `-n`, to the network file *file*.

    Reports what a file cannot have, and invalid concise DCFs. Asks before overwriting. Raises UsageError if *manager*
    has no concise DCFs, or only empty ones.
    """
    path = network_place(file, "NAME.yaml")
    ask_before_overwriting(session, path)
    node = session.node(manager)
    node.read_anew()
    notes: list[str] = []
    found: list[FoundNode] = []
    unnamed: list[str] = []
    for node_id, downloads in _downloads(session, node, notes):
        device = _device(session, node, node_id, path, notes)
        exported, unsaid = node_from_frames(device, downloads)
        dcf = None if device.eds is None else eds_word(device.eds, path)
        config = replace(exported.config, identity=device.identity, dcf=dcf)
        notes += _notes(config, unsaid)
        unnamed += [str(node_id)] if device.eds is None else []
        found.append(FoundNode(replace(exported, config=config), {}, node.read_cache))
    if not found:
        why = f": {'; '.join(notes)}" if notes else ""
        raise UsageError(f"node {manager} ({node.title}) downloads no values to any node{why}", node=manager)
    if unnamed:
        notes.append(f"{all_nodes(unnamed)}: no EDS, so objects are written as numbers; `dcf:` names an EDS")
    return write_found(
        session, path, file, f"Values that node {manager} downloads to the nodes that it boots", found, notes
    )


def _notes(config: NodeConfig, unsaid: tuple[str, ...]) -> Iterator[str]:
    if unsaid:
        yield f"node {config.node_id}: left out: {', '.join(unsaid)}"
    if config.stamp:
        yield f"node {config.node_id}: its 0x1020 becomes `stamp: true`, which writes another date and time"


def _downloads(
    session: SessionUser, node: ReadableNode, notes: list[str]
) -> Iterator[tuple[int, tuple[ConciseEntry, ...]]]:
    """Yield the downloads of *node* by node-ID; reports invalid and unreadable concise DCFs."""
    try:
        count = node.observed(partial(node.known_value, CONCISE_DCF, 0))
    except SdoAborted as aborted:
        raise no_manager(node, f"{CONCISE_DCF:04X}:00", aborted) from aborted
    wanted = session.base.nodes
    for node_id in range(1, min(int.from_bytes(count[:1], "little"), 127) + 1):
        if wanted and node_id not in wanted:
            continue
        session.reporter.progress(f"node {node.node_id}: reading its download values", node_id, 127)
        try:
            data = node.observed(partial(node.known_value, CONCISE_DCF, node_id))
            if any(data):
                yield node_id, concise_entries(data)
        except SdoAborted as aborted:
            notes.append(f"node {node_id} is left out: {aborted.text}")
        except ValueError as wrong:
            notes.append(f"node {node_id} is left out: 0x1F22:{node_id:02X} is not a concise DCF: {wrong}")


def _device(session: SessionNodes, manager: ReadableNode, node_id: int, path: Path, notes: list[str]) -> _Booted:
    """Identify the node: as expected by *manager*, else by itself; with the EDS."""
    expected = _identity(manager, node_id)
    try:
        files = session.network.files
        held = ExpectedIdentity(*(read_identity(files.read_cache(node_id), sub_index) or None for sub_index in (1, 2)))
        if all(wanted in (None, told) for wanted, told in zip(_parts(expected), _parts(held), strict=True)):
            return _Booted(node_id, held, files.eds_path(node_id))
        notes.append(f"node {node_id} is another device than node {manager.node_id} expects (0x1F85, 0x1F86)")
    except (NoAnswer, SdoAborted, SdoProtocolError):
        pass
    word = simulated_word(str(path), NodeConfig("", node_id, expected))
    return _Booted(node_id, expected, None if word is None else file_or_family(word))


def _parts(identity: ExpectedIdentity) -> tuple[int | None, ...]:
    """Return vendor and product: a manager checks only set values (CiA 302-2, 0x1F85, 0x1F86: 0 is any)."""
    return identity.vendor, identity.product


def _identity(manager: ReadableNode, node_id: int) -> ExpectedIdentity:
    numbers: list[int | None] = []
    for index in _EXPECTED:
        try:
            data = manager.observed(partial(manager.known_value, index, node_id))
        except SdoAborted:
            data = b""
        numbers.append(int.from_bytes(data, "little") or None)
    return ExpectedIdentity(*numbers)

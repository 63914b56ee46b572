"""Export nodes of a bus, or of files, as a network file. Writes nothing to a node."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from dvtcli.device.read_pdos import read_optional
from dvtcli.device.seen_state import heartbeat_ms, heartbeat_slots
from dvtcli.domain.can_ids import EMCY_BASE
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.network.links import found_links, watched_ms
from dvtcli.domain.network.network_config import (
    ExpectedIdentity,
    FileWord,
    HeartbeatWatch,
    NetworkConfig,
    NodeConfig,
    ObjectConfig,
    PartialPdoConfig,
    PinConfig,
    ValueConfig,
)
from dvtcli.domain.object_dictionary import normalised
from dvtcli.domain.object_syntax import MappedObject, resolve_entry
from dvtcli.domain.objects import COB_ID_EMCY, CONSUMER_HEARTBEAT, ERROR_BEHAVIOUR, INHIBIT_TIME_EMCY, SYNC_OVERFLOW
from dvtcli.domain.pdo import MAX_PDO_BITS
from dvtcli.domain.profile import BitPolicy
from dvtcli.domain.text import join_some, plural
from dvtcli.errors import SdoAborted, UsageError
from dvtcli.files.device_library import stored_path
from dvtcli.files.network.network_keys import OF, Where
from dvtcli.files.network.write_network import write_network
from dvtcli.operations.plans.resolve_names import following
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of
from dvtcli.operations.session.simulated_nodes import file_or_family
from dvtcli.simulator.network.family_file import family_of

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.network.network_config import Endpoint
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry
    from dvtcli.domain.ports import SdoReader
    from dvtcli.domain.profile import DeviceProfile, VpdoGroup
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


def exported_node(session: SessionNodes, node: ReadableNode, held: Mapping[Pdo, PdoConfig], path: Path) -> Exported:
    """Export *node* with the PDOs *held* to the network file *path*.

    The file always names the EDS: its identity may lead to another file later, when one is added to the library.
    """
    found = exported(node, held, node.read_cache, all_of(node.dictionary))
    dcf, modules = _dcf(session, node, path), _modules(session, node)
    return replace(found, config=replace(found.config, dcf=dcf, modules=modules, profile=session.options.profile))


def _modules(session: SessionNodes, node: NodeDescription) -> tuple[int, ...] | None:
    """Return the connected modules of *node*, None if its EDS is of no modular device, or says them itself."""
    files = session.network.files
    path = files.eds_path(node.node_id)
    return None if path is None else files.modules(node.node_id, path)


def _dcf(session: SessionNodes, node: NodeDescription, path: Path) -> FileWord | None:
    """Return the path, for *path*, of the EDS of *node*; None if it has none."""
    if session.options.eds is not None:
        return eds_word(file_or_family(session.options.eds), path)
    eds = session.network.files.eds_path(node.node_id)
    return None if eds is None else eds_word(eds, path)


def eds_word(eds: Path, path: Path) -> FileWord:
    """Name *eds* in the network file *path*: as a family, a library file, or a path."""
    family = family_of(eds)
    if family is not None:
        return FileWord(family)
    return FileWord(eds.name) if stored_path(eds.name) == eds else beside(eds, path)


def beside(eds: Path, path: Path) -> FileWord:
    """Return the path of *eds* relative to the network file *path*."""
    try:
        return FileWord(Path(os.path.relpath(eds, path.parent)).as_posix())
    except ValueError:  # on another drive
        return FileWord(eds.absolute().as_posix())


SUFFIXES = (".yaml", ".yml")


def export_node(session: SessionNodes, file: str, node_id: int | None = None) -> Facts:
    """Export every PDO of the node with *node_id* (None: the selected node) to the network file *file*.

    Asks before overwriting. Incomplete PDOs and MPDOs are left out and reported. Raises UsageError for another suffix,
    if no node is selected, or the file cannot be written.
    """
    path = network_place(file, "NAME.yaml")
    if node_id is None and session.selected_id() is None:
        hint = (
            Hint(Action.GIVE, {"node_id": "ID"}, "names it")
            + Hint(Action.SHOW_NODE, {"node": "ID"}, ", or {}")
            + Hint(Action.IMPORT, {"file": file}, "writes all nodes of the network")
        )
        raise UsageError("export writes one node to a network file, and none is selected", hint=hint)
    node = session.node(node_id)
    found = exported_node(session, node, node.pdos(), path)
    ask_before_overwriting(session, path)
    make_file(
        session, path, write_network(NetworkConfig((found.config,)), f"Values of node {node.node_id}", found.remarks)
    )
    count = len(found.config.pdos)
    counted = f"{verbatim(file)}: node {node.node_id}, {plural(count, 'PDO')}"
    said: list[Hint | str] = [Hint(Action.CHECK, {"file": file}, f"{counted}. Check it: {{}}")]
    if note := found.left_out_note:
        said.append(f"note: {note}")
    if others := [str(known_id) for known_id in session.known_ids() if known_id != node.node_id]:
        said.append(
            Hint(Action.GIVE, {"node_id": others[0]}, f"This is node {node.node_id} only: {{}} exports another")
            + Hint(Action.IMPORT, {"file": "FILE.yaml"}, ", {} all nodes.")
        )
    rows = (("file", file), ("node", node.node_id), ("pdos", count), ("left_out", list(found.left_out)))
    return Facts("export", rows, tuple(said))


def network_place(file: str, example: str) -> Path:
    """Return the path of the network file *file*; raises UsageError for another suffix or a bad place."""
    if not file.lower().endswith(SUFFIXES):
        hint = Hint(Action.EXPORT, {"file": "FILE.dcf"}, "writes a DCF") + Hint(
            Action.SAVE_SCRIPT, {"all": True}, ", {} a script"
        )
        raise UsageError(f"{file}: a network file ends in .yaml", hint=hint)
    return place_of(file, example)


def exported_pins(values: SdoReader, groups: Mapping[str, VpdoGroup]) -> Iterator[PinConfig]:
    """Yield the pins of each of *groups* by name, up to the last connected pin."""
    for name, group in sorted(groups.items()):
        try:
            held = list(_held_words(values, group))
        except SdoAborted:
            continue  # what cannot be read is not compared either
        while held and held[-1] == group.none:
            held.pop()
        for pin, value in enumerate(held, 1):
            yield PinConfig(name, pin, None if value == group.none else FileWord(f"{value:04X}"))


def _held_words(values: SdoReader, group: VpdoGroup) -> Iterator[int]:
    for pin in range(1, (read_optional(values, group.index, 0, 1) or 0) + 1):
        value = read_optional(values, group.index, pin, 2)
        if value is None:
            return
        yield value


class NamedNode(Protocol):
    """A node with object names."""

    @property
    def node_id(self) -> int:
        """The node-ID."""
        ...

    @property
    def title(self) -> str:
        """The device's name."""
        ...

    @property
    def dictionary(self) -> ObjectDictionary | None:
        """The object dictionary."""
        ...

    @property
    def profile(self) -> DeviceProfile:
        """The family's profile."""
        ...


class PdoHolder(NamedNode, Protocol):
    """A holder of PDOs: a node, or a file with its values."""

    def identity(self) -> dict[str, int | None]:
        """The identity (0x1018)."""
        ...


@dataclass(frozen=True, slots=True)
class Exported:
    """A node for a network file: its PDOs, remarks on words, and PDOs left out."""

    config: NodeConfig
    remarks: dict[tuple[int, str], str]
    left_out: tuple[str, ...]

    @property
    def left_out_note(self) -> str:
        """Report what was left out; empty if nothing."""
        if not self.left_out:
            return ""
        verb = "is incomplete" if len(self.left_out) == 1 else "are incomplete"
        listed = join_some(self.left_out)
        return f"left out: {listed} {verb}, or multiplexed; the list of the node's PDOs shows their present values"


def exported(holder: PdoHolder, held: Mapping[Pdo, PdoConfig], values: SdoReader, said: Said) -> Exported:
    """Convert the PDOs *held* of *holder*, and the objects in *values*, for a network file.

    Usual values are included if *said*.
    """
    remarks: dict[str, str] = {}
    pdo_configs = tuple(_pdo(holder, pdo, config, remarks) for pdo, config in held.items() if is_complete(config))
    found = exported_objects(values, holder.dictionary, said)
    objects = sorted(found, key=lambda entry: (entry.index, entry.sub_index))
    watches = tuple(exported_watches(values))
    others = dict(exported_values(values, holder.dictionary, watches, holder.node_id, said))
    remarks |= {other_pin.object.text: sense for other_pin, sense in others.items()}
    node_config = NodeConfig(
        title_word(holder), holder.node_id, _identity(holder), pdos=pdo_configs, objects=tuple(objects),
        values=tuple(others), watches=watches, pins=tuple(exported_pins(values, holder.profile.vpdo)),
    )  # fmt: skip
    left_out = tuple(pdo.label for pdo, config in held.items() if not is_complete(config))
    return Exported(node_config, {(holder.node_id, word): text for word, text in remarks.items()}, left_out)


def is_complete(config: PdoConfig) -> bool:
    """Tell whether a network file can have it: no MPDO, nothing unknown, each entry has a length."""
    has_bits = all(1 <= entry.bits <= MAX_PDO_BITS for entry in config.mapping)
    return config.mpdo is None and not config.inconsistency and has_bits


def title_word(holder: NamedNode) -> str:
    """Name the node in the file: device name and node-ID, to be unique."""
    word = re.sub(r"[^a-z0-9_]", "", normalised(holder.title).replace(".", "_"))
    return f"{word}_{holder.node_id}" if word and word[0].isalpha() else f"node_{holder.node_id}"


def _identity(holder: PdoHolder) -> ExpectedIdentity:
    """Return the kind of device, as the file may serve another of the same kind."""
    found = holder.identity()
    return ExpectedIdentity(found["vendor"] or None, found["product"] or None)


def _pdo(holder: PdoHolder, pdo: Pdo, config: PdoConfig, remarks: dict[str, str]) -> PartialPdoConfig:
    held = config.communication
    cob_id = held.cob_id
    named = bool(cob_id.can_id)  # a COB-ID of 0 that is off is no CAN-ID
    unlike_others = cob_id.rtr_allowed and holder.profile.rtr_bit[pdo.direction] is BitPolicy.SET
    return PartialPdoConfig(
        pdo,
        enabled=cob_id.valid,
        cob_id=cob_id.can_id if named else None,
        extended=cob_id.extended and named,
        rtr_allowed=cob_id.rtr_allowed if not cob_id.rtr_allowed or unlike_others else None,
        transmission_type=held.transmission_type,
        inhibit_time=held.inhibit_time if pdo.is_tpdo else None,
        event_timer=held.event_timer,
        sync_start_value=held.sync_start_value if pdo.is_tpdo else None,
        mapping=tuple(mapped_word(holder, entry, remarks) for entry in config.mapping),
    )


def mapped_word(holder: NamedNode, entry: PdoMappingEntry, remarks: dict[str, str]) -> FileWord:
    """Name the entry by object name if unique, else by number; the other is the remark."""
    name = "" if holder.dictionary is None else holder.dictionary.display_name(entry.index, entry.sub_index)
    word = "" if entry.is_dummy else _named(holder, name, entry)
    remarks[word or str(entry)] = f"skips {entry.bits} bits" if entry.is_dummy else str(entry) if word else name
    return FileWord(word or str(entry))


def _named(holder: NamedNode, name: str, entry: PdoMappingEntry) -> str:
    """Return the name as one word, if the EDS resolves it to the object with the mapped length."""
    word = normalised(name)
    if not re.fullmatch(r"[a-z_][a-z0-9_]*", word) or holder.dictionary is None:
        return ""
    try:
        found = resolve_entry(word, holder.dictionary, holder.profile.aliases)
    except ValueError:
        return ""  # the name of several objects
    alone = found == MappedObject(entry.index, entry.sub_index)
    described = holder.dictionary.entry(entry.index, entry.sub_index)
    return word if alone and described is not None and described.bits == entry.bits else ""


#: whether a file has an object, by index and sub-index, even with its usual value
Said = Callable[[int, int], bool]
#: bits 0 to 29 of a COB-ID: the CAN-ID and its 29-bit flag
_IDENTIFIER = 0x3FFF_FFFF
#: objects without a key: index, size in bytes, meaning
_WITHOUT_KEY = {
    (COB_ID_EMCY, 4): "COB-ID of EMCY",
    (INHIBIT_TIME_EMCY, 2): "inhibit time of EMCY, 100 µs",
    (SYNC_OVERFLOW, 1): "overflow of SYNC's counter",
}
#: default values (CiA 301, 7.5.2.5 to 7.5.2.15), which a file need not have
_USUAL = {0x1005: (0x80, 0x8000_0080), 0x1006: (0,), 0x100C: (0,), 0x100D: (0,), 0x1012: (0x100, 0x8000_0100)}


def all_of(dictionary: ObjectDictionary | None) -> Said:
    """Export everything that a node has by its EDS: the file records its state."""
    return lambda index, sub_index: dictionary is None or dictionary.entry(index, sub_index) is not None


def values_of(dictionary: ObjectDictionary) -> Said:
    """Export values in a DCF or XDC; nothing of an EDS."""

    def said(index: int, sub_index: int) -> bool:
        entry = dictionary.entry(index, sub_index)
        return entry is not None and entry.value is not None

    return said


def exported_objects(values: SdoReader, dictionary: ObjectDictionary | None, said: Said) -> Iterator[ObjectConfig]:
    """Yield 0x1017 if present, and of the others those *said* or not at their usual value."""
    for key in OF[Where.NODE].values():
        if key.object is None:
            continue
        index, sub_index, size = key.object
        held = _held(values, index, sub_index, size)
        if held is None or _is_fixed(dictionary, index, sub_index):
            continue
        if held not in _USUAL.get(index, ()) or said(index, sub_index):
            yield ObjectConfig(key.name, index, sub_index, held.to_bytes(size, "little"))


def exported_behaviours(values: SdoReader, dictionary: ObjectDictionary, said: Said) -> Iterator[ObjectConfig]:
    """Yield the error behaviours (0x1029) that are *said*."""
    for entry in dictionary.entries():
        place = entry.index, entry.sub_index
        if place[0] == ERROR_BEHAVIOUR and place[1] and entry.access.writable and said(*place):
            held = _held(values, *place, 1)
            if held is not None:
                yield ObjectConfig("error_behavior", *place, bytes([held]))


def exported_values(
    values: SdoReader,
    dictionary: ObjectDictionary | None,
    watches: Collection[HeartbeatWatch],
    node_id: int,
    said: Said,
) -> Iterator[tuple[ValueConfig, str]]:
    """Yield EMCY, SYNC counter and entries of 0x1016 except *watches*, if *said*, with their meaning.

    They have no keys of their own. A default EMCY COB-ID of *node_id* follows the node-ID. Objects missing in the EDS
    are left out: they could not be checked without the node.
    """
    for (index, size), sense in _WITHOUT_KEY.items():
        held = _held(values, index, 0, size)
        if held is not None and said(index, 0) and not _is_fixed(dictionary, index, 0):
            is_own = index == COB_ID_EMCY and held & _IDENTIFIER == EMCY_BASE + node_id
            text = following(held - node_id) if is_own else f"0x{held:X}" if size == 4 else str(held)
            yield ValueConfig(FileWord(f"{index:04X}:00"), FileWord(text)), sense
    left = {(watch.producer, watch.time_ms) for watch in watches}
    for sub_index, value in _slots(values).items():
        producer, time_ms = value >> 16 & 0xFF, value & 0xFFFF
        if (producer, time_ms) in left:
            left.remove((producer, time_ms))
        elif said(CONSUMER_HEARTBEAT, sub_index) and not _is_fixed(dictionary, CONSUMER_HEARTBEAT, sub_index):
            sense = "monitors no node" if not value else "as in the device"
            yield ValueConfig(FileWord(f"{CONSUMER_HEARTBEAT:04X}:{sub_index:02X}"), FileWord(f"0x{value:X}")), sense


def _held(values: SdoReader, index: int, sub_index: int, size: int) -> int | None:
    """Return the value; None if absent or unreadable: not compared."""
    try:
        return read_optional(values, index, sub_index, size)
    except SdoAborted:
        return None


def _slots(values: SdoReader) -> dict[int, int]:
    try:
        return heartbeat_slots(values)
    except SdoAborted:
        return {}


def _is_fixed(dictionary: ObjectDictionary | None, index: int, sub_index: int) -> bool:
    described = dictionary.entry(index, sub_index) if dictionary else None
    return described is not None and not described.access.writable


def exported_watches(values: SdoReader) -> Iterator[HeartbeatWatch]:
    """Yield the used entries of 0x1016, one per producer, by node-ID."""
    found: dict[int, int] = {}
    for value in _slots(values).values():
        producer, time_ms = value >> 16 & 0xFF, value & 0xFFFF
        if time_ms and 1 <= producer <= 127:
            found.setdefault(producer, time_ms)
    yield from (HeartbeatWatch(producer, time_ms) for producer, time_ms in sorted(found.items()))


@dataclass(frozen=True, slots=True)
class FoundNode:
    """A node of the network: its export, its PDOs, and the reader of its heartbeats."""

    exported: Exported
    held: Mapping[Pdo, PdoConfig]
    values: SdoReader


def write_found(
    session: SessionUser, path: Path, file: str, title: str, found: list[FoundNode], notes: Sequence[Hint | str]
) -> Facts:
    """Write the nodes *found* and their links to *path*, named *file* by the user, under *title*.

    The result has *notes* and the number of errors by `check`.
    """
    nodes = {node.exported.config.node_id: node for node in found}
    links = found_links(
        {node_id: exported_node.held for node_id, exported_node in nodes.items()},
        lambda consumer, producer: _watches(nodes[consumer].values, nodes[producer].values, producer),
    )
    notes = [*notes, *map(_unlike, links.unlike)]
    options = tuple(exported_node.exported.config for _, exported_node in sorted(nodes.items()))
    remarks = {word: text for node in found for word, text in node.exported.remarks.items()}
    make_file(session, path, write_network(NetworkConfig(options, links.links), title, remarks))
    pdos = sum(len(config.pdos) for config in options)
    counts = f"{plural(len(options), 'node')}, {plural(pdos, 'PDO')}, {plural(len(links.links), 'link')}"
    errors = _errors(file)
    judged = f"{plural(errors, 'error')} to correct first" if errors else "Check it"
    checked = Hint(Action.CHECK, {"file": file}, f"{verbatim(file)}: {counts}. {judged}: {{}}")
    said: list[Hint | str] = [checked, *map(noted, notes)]
    rows = (
        ("file", file),
        ("nodes", [_row(exported_node) for _, exported_node in sorted(nodes.items())]),
        ("links", len(links.links)),
        ("errors", errors),
        ("notes", notes),
    )
    return Facts("import", rows, tuple(said))


def _unlike(ends: tuple[Endpoint, Endpoint]) -> str:
    received, sent = (f"{end.node_id}:{end.pdo}" for end in ends)
    return f"{received} receives {sent}, but their layouts differ: no link"


def noted(note: Hint | str) -> Hint | str:
    """Return *note* with `note:` before it."""
    return replace(note, why=f"note: {note.why}") if isinstance(note, Hint) else f"note: {note}"


def _errors(file: str) -> int:
    """Count errors by `check` in the written file: not everything that devices hold can be written again."""
    from dvtcli.operations.network.check_networks import CheckOptions, check_networks

    (report,) = check_networks((file,), CheckOptions(as_findings=True)).reports
    return report.count()["error"]


def _row(one: FoundNode) -> dict[str, object]:
    config = one.exported.config
    left_out = list(one.exported.left_out)
    return {"node": config.node_id, "name": config.name, "pdos": len(config.pdos), "left_out": left_out}


def _watches(consumer: SdoReader, producer: SdoReader, producer_id: int) -> bool:
    """Tell whether nothing is left to set up: no heartbeat producer, or the consumer time is long enough."""
    try:
        time_ms = heartbeat_ms(producer) or 0
        return not time_ms or watched_ms(heartbeat_slots(consumer), producer_id) > time_ms
    except SdoAborted:
        return False

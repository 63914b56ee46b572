"""Import a network from its bus, or from a folder of EDS files, as a network file. Writes nothing to a node."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvtcli.device.described_node import Defaults, FileValues
from dvtcli.device.file_fits import refuse_unlike_file
from dvtcli.device.quirks import in_standard_order
from dvtcli.device.read_pdos import WHATEVER, present_pdos, read_identity, read_pdo
from dvtcli.device.unnamed_nodes import add_eds
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.objects import CONSUMER_HEARTBEAT
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.text import all_nodes, join_some, plural, some_nodes
from dvtcli.errors import DvtcliError, InputFileError, NoAnswer, SdoAborted, SdoProtocolError, UsageError
from dvtcli.files.device_file import DEVICE_SUFFIXES, must_not_be_cut, read_device_file
from dvtcli.files.file_info import is_read_out
from dvtcli.files.input_file import read_input
from dvtcli.files.nodelist import MOST_BYTES as NODELIST_MOST_BYTES
from dvtcli.files.nodelist import SUFFIX, ListedNode, read_nodelist
from dvtcli.files.profiles import profile_of
from dvtcli.files.unread_values import must_tell_values
from dvtcli.operations.exchange.export_network import (
    FoundNode,
    all_of,
    beside,
    exported,
    exported_behaviours,
    exported_node,
    network_place,
    values_of,
    write_found,
)
from dvtcli.operations.nodes.find_nodes import find_nodes
from dvtcli.operations.plans.read_network_config import tell_unknown_bit_rate
from dvtcli.operations.session.save_script import ask_before_overwriting
from dvtcli.operations.session.simulated_nodes import read_dictionary

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.network.network_config import NodeConfig, PartialPdoConfig
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.pdo import PdoConfig
    from dvtcli.domain.ports import SdoReader
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import SessionNodes


@dataclass(frozen=True, slots=True)
class ListedFile:
    """The file of a node: path, and *node_id* and *name* of the nodelist."""

    path: Path
    node_id: int
    name: str


def nodelist_in(place: Path) -> Path | None:
    """Return *place* if it is a nodelist, or the nodelist in it; None if none. Raises UsageError for several."""
    if place.suffix.lower() == SUFFIX and place.is_file():
        return place
    found = sorted(path for path in place.iterdir() if path.suffix.lower() == SUFFIX) if place.is_dir() else []
    if len(found) > 1:
        names = join_some(path.name for path in found)
        raise UsageError(f"{place} has several nodelists: {names}", hint=f"give the name: {found[0]}")
    return found[0] if found else None


def listed_files(nodelist: Path, notes: list[Hint | str]) -> list[ListedFile]:
    """Read the files in *nodelist* by node-ID; *notes* gets entries left out.

    Raises InputFileError if it is invalid or a file is missing; UsageError if it cannot be read.
    """
    try:
        networks = read_nodelist(read_input(nodelist, NODELIST_MOST_BYTES, "nodelist"), nodelist.name)
    except OSError as failed:
        raise UsageError(f"{nodelist}: {failed.strerror or failed}", place=str(nodelist)) from failed
    first, *others = networks
    notes += (
        f"{nodelist.name}: network {other.name or 'without a name'} is left out: one file, one bus" for other in others
    )
    if first.absent:
        notes.append(f"{nodelist.name}: not present: {some_nodes(first.absent)}")
    found = []
    for node in first.nodes:
        if node.dcf:
            found.append(ListedFile(_file(nodelist, node), node.node_id, node.name))
        else:
            notes.append(f"node {node.node_id} is left out: {nodelist.name} has no DCF for it")
    if not found:
        raise UsageError(f"{nodelist} lists no DCF", place=str(nodelist), hint="add NodeXDCFName")
    return found


def _file(nodelist: Path, node: ListedNode) -> Path:
    r"""Find the DCF of *node* beside the nodelist, ignoring case and with \ as separator."""
    path = nodelist.parent / node.dcf.replace("\\", "/")
    if os.path.isfile(path):  # noqa: PTH113 - Path.is_file raises OSError for a name that is too long
        return path
    near = path.parent.iterdir() if os.path.isdir(path.parent) else ()  # noqa: PTH112
    same = [neighbour for neighbour in near if neighbour.name.lower() == path.name.lower()]
    if len(same) != 1:
        raise InputFileError(
            f"{nodelist.name}:{node.line}: the DCF of node {node.node_id} does not exist: {node.dcf}",
            place=f"{nodelist}:{node.line}", hint="it must be in the folder of the nodelist",
        )  # fmt: skip
    return same[0]


@dataclass(frozen=True, slots=True)
class _FileNode:
    """A node by its EDS, DCF, XDD or XDC at *path*."""

    path: Path
    node_id: int
    dictionary: ObjectDictionary
    profile: DeviceProfile
    #: its name in a nodelist
    name: str = ""

    @property
    def title(self) -> str:
        """The device name in its nodelist, else in its file."""
        return self.name or self.dictionary.info.product_name or self.profile.title

    @property
    def values(self) -> SdoReader:
        """The values in the file."""
        return in_standard_order(FileValues(self.dictionary, self.node_id), self.profile)

    def identity(self) -> dict[str, int | None]:
        """The identity (0x1018) in the file, or its device information."""
        info = self.dictionary.info.identity
        told = {name: info[name] for name in ("vendor", "product")}
        return {name: told[name] or read_identity(self.values, sub) for sub, name in enumerate(told, 1)}


def nodes_of_files(folder: Path, path: Path, notes: list[Hint | str]) -> Iterator[FoundNode]:
    """Yield the nodes of the EDS and DCF files in *folder* for the network file *path*; *notes* gets omissions.

    Raises UsageError if there are none.
    """
    usual: list[str] = []
    described = _described(folder, notes)
    for node in described:
        yield _of_file(node, path, notes, usual)
    notes += _bit_rate_of_files(described, path)
    if usual:
        files = "its file" if len(usual) == 1 else "their files"
        notes.append(
            f"{all_nodes(usual)}: other values of {files} left out, all equal to the defaults: apply a file "
            f"itself to write its configuration objects"
        )


def _bit_rate_of_files(nodes: Sequence[_FileNode], path: Path) -> Iterator[Hint | str]:
    """Note the bit rate of the DCFs of *nodes*, or that they have several."""
    rates = sorted({rate for node in nodes if (rate := node.dictionary.info.commissioning.bit_rate_kbit)})
    if len(rates) == 1:
        yield _bit_rate_note(path, 1000 * rates[0])
    elif rates:
        yield f"the files have several bit rates: {', '.join(map(str, rates))} kbit/s; a network has one"


def _bit_rate_note(path: Path, bit_rate: int) -> Hint:
    """Say how *bit_rate* (bit/s) gets into a check of the network file *path*, which has whole kbit/s only.

    It is not written: it stands in the section `master`, and `check` takes a master for the other side of PDOs.
    """
    whole = f", or, with a master, master: {{{{baudrate: {bit_rate // 1000}}}}}"
    why = f"no bit rate in the file: for load and deadlines, {{}}{'' if bit_rate % 1000 else whole}"
    return Hint(Action.CHECK, {"file": path, "bit_rate": bit_rate}, why)


def _of_file(node: _FileNode, path: Path, notes: list[Hint | str], usual: list[str]) -> FoundNode:
    """Return *node* for the network file *path*; *usual* gets its node-ID if it has other values, all defaults."""
    configs: dict[Pdo, PdoConfig] = {}
    without_values = _pdos_without_values(node)
    if without_values:
        labels = join_some(pdo.label for pdo in without_values)
        notes.append(f"node {node.node_id}: {labels} left out: {node.path.name} has no values of it")
    present = present_pdos(node.values, node.dictionary)
    unmapped = [pdo for pdo in present if pdo not in without_values and _is_mapping_unknown(node, pdo)]
    if unmapped:
        labels = join_some(pdo.label for pdo in unmapped)
        notes.append(f"node {node.node_id}: {labels} left out: {node.path.name} does not say what the mapping is")
    for pdo in present:
        if pdo in without_values or pdo in unmapped:
            continue
        try:
            configs[pdo] = read_pdo(node.values, pdo, WHATEVER)
        except SdoAborted:
            continue  # it has neither COB-ID nor mapping: no such PDO
    file_values = values_of(node.dictionary)
    found = exported(node, configs, node.values, file_values)
    behaviours = exported_behaviours(node.values, node.dictionary, file_values)
    pdos = _without_unsaid(node, found.config.pdos, notes)
    objects = (*found.config.objects, *behaviours)
    config = replace(found.config, dcf=beside(node.path, path), objects=objects, pdos=pdos)
    left_out = _values_left_out(node, config)
    not_default = _not_default(node, left_out)
    if not_default:
        differ = "1 differs" if len(not_default) == 1 else f"{len(not_default)} differ"
        notes.append(
            f"node {node.node_id}: {plural(len(left_out), 'other value')} of {node.path.name} left out, {differ} from "
            f"the defaults ({join_some(not_default)}): apply that file itself to write its configuration objects"
        )
    elif left_out:
        usual.append(str(node.node_id))
    return FoundNode(replace(found, config=config), configs, node.values)


#: what a network file says of a PDO: field, key in the file, and the object's sub-index
_OF_PDO = (
    ("transmission_type", "transmission", 2), ("inhibit_time", "inhibit_ms", 3),
    ("event_timer", "event_timer", 5), ("sync_start_value", "sync_start", 6),
)  # fmt: skip


def _without_unsaid(
    node: _FileNode, pdos: Sequence[PartialPdoConfig], notes: list[Hint | str]
) -> tuple[PartialPdoConfig, ...]:
    """Leave out of *pdos* what the file of *node* has no value of; *notes* gets it.

    The device has its own value, which a network file would overwrite.
    """
    left: dict[tuple[str, ...], list[str]] = {}
    found = []
    for config in pdos:
        unsaid = [
            row for row in _OF_PDO if getattr(config, row[0]) is not None and _is_untold(node, config.pdo, row[2])
        ]
        if unsaid:
            left.setdefault(tuple(key for _, key, _ in unsaid), []).append(config.pdo.label)
        nothing: dict[str, Any] = dict.fromkeys(field for field, _, _ in unsaid)
        found.append(replace(config, **nothing))
    for keys, labels in left.items():
        what = " and ".join(filter(None, (", ".join(keys[:-1]), keys[-1])))
        notes.append(
            f"node {node.node_id}: {what} of {join_some(labels)} left out: {node.path.name} has no value of it"
        )
    return tuple(found)


def _is_untold(node: _FileNode, pdo: Pdo, sub_index: int) -> bool:
    entry = node.dictionary.entry(pdo.communication_index, sub_index)
    return entry is not None and entry.at_power_on(node.node_id) is None


def _values_left_out(node: _FileNode, config: NodeConfig) -> list[OdEntry]:
    """Return the writable values of *node* missing in *config*: a network file is not a full backup."""
    taken = {f"{value.index:04X}:{value.sub_index:02X}" for value in config.objects}
    taken |= {value.object.text for value in config.values}
    pins = {group.index for group in node.profile.vpdo.values()}
    return [
        entry
        for entry in node.dictionary.entries()
        if entry.value is not None and entry.access.writable and Pdo.at(entry.index) is None
        and entry.object not in taken and entry.index not in {*pins, CONSUMER_HEARTBEAT}
    ]  # fmt: skip


def _not_default(node: _FileNode, entries: Sequence[OdEntry]) -> list[str]:
    """Return the objects of *entries* whose values differ from the defaults."""
    defaults = Defaults(node.dictionary, node.node_id)
    return [entry.object for entry in entries if _default(defaults, entry) != entry.initial(node.node_id)]


def _default(defaults: Defaults, entry: OdEntry) -> bytes | None:
    try:
        return defaults.known_value(entry.index, entry.sub_index)
    except SdoAborted:
        return None


def _pdos_without_values(node: _FileNode) -> list[Pdo]:
    """List PDOs in the EDS without a value in the DCF: the device may lack them.

    In files of other tools, a missing value means the default (CiA 306).
    """
    if not is_read_out(node.path):
        return []
    said = {Pdo.at(entry.index) for entry in node.dictionary.entries() if entry.value is not None}
    return [pdo for pdo in present_pdos(node.values, node.dictionary) if pdo not in said]


def _is_mapping_unknown(node: _FileNode, pdo: Pdo) -> bool:
    """Tell whether the file lists the mapping of *pdo* without its count: what the device maps is not known."""
    count = node.dictionary.entry(pdo.mapping_index, 0)
    return count is not None and count.value is None and count.default is None


def _read(path: Path) -> ObjectDictionary:
    """Read the whole file at *path*: its values become those of the network file."""
    dictionary = read_dictionary(path)  # a file that cannot be read is an error with its remedy
    read = read_device_file(path)
    must_not_be_cut(read)
    must_tell_values(read, str(path))
    return dictionary


def _described(folder: Path, notes: list[Hint | str]) -> list[_FileNode]:
    """Return the nodes of files in *folder*, with their own or the next free node-ID.

    If *folder* is or has a nodelist, those in the nodelist.
    """
    if (nodelist := nodelist_in(folder)) is not None:
        listed = listed_files(nodelist, notes)
        read = [(file, _read(file.path)) for file in listed]
        return [
            _FileNode(listed_node.path, listed_node.node_id, held, profile_of(held), listed_node.name)
            for listed_node, held in read
        ]
    try:
        paths = sorted(file_path for file_path in folder.iterdir() if file_path.suffix.lower() in DEVICE_SUFFIXES)
    except OSError as failed:
        hint = "a folder of EDS, DCF, XDD or XDC files"
        raise UsageError(f"{folder}: {failed.strerror or failed}", hint=hint) from failed
    if not paths:
        raise UsageError(f"{folder} has no EDS, DCF, XDD or XDC file")
    dictionaries = {path: _read(path) for path in paths}
    ids: dict[Path, int] = {}
    for path, dictionary in dictionaries.items():
        own = dictionary.info.node_id
        if own is not None and 1 <= own <= 127 and own not in ids.values():
            ids[path] = own
    numbered: dict[Path, int] = {}
    for path in (path for path in paths if path not in ids):
        free = next((number for number in range(1, 128) if number not in ids.values()), None)
        if free is None:
            raise UsageError(f"{folder} has {len(paths)} files, a network has 127 nodes")
        ids[path] = numbered[path] = free
    notes += _given_ids(numbered)
    found = [
        _FileNode(path, ids[path], file_dictionary, profile_of(file_dictionary))
        for path, file_dictionary in dictionaries.items()
    ]
    return sorted(found, key=lambda node: node.node_id)


def _given_ids(node_ids: Mapping[Path, int]) -> list[Hint | str]:
    """Note in a line which files without a node-ID get which."""
    if len(node_ids) == 1:
        ((path, node_id),) = node_ids.items()
        return [f"{path.name} has no node-ID: it becomes node {node_id}"]
    given = ", ".join(f"{path.name} becomes node {node_id}" for path, node_id in node_ids.items())
    return [f"{len(node_ids)} files have no node-ID: {given}"] if node_ids else []


def import_network(session: SessionNodes, file: str, folder: str | None = None, manager: int | None = None) -> Facts:
    """Import answering nodes (scan or `-n`) and their links to the network file *file*.

    *folder*: its EDS and DCF files instead, without a bus; a DCF has its node-ID, others are numbered. A nodelist (CiA
    306-3) in, or as, *folder* gives its nodes and DCFs. *manager*: what that node downloads to its nodes. Asks before
    overwriting. Raises NoAnswer if no node answers, UsageError if there is no such file or nothing in it, or both are
    given.
    """
    if manager is not None:
        from dvtcli.operations.exchange.import_manager import import_manager

        if folder is not None:
            raise UsageError(f"{folder} is given, too: give only one of them", given={"from_manager": manager})
        return import_manager(session, file, manager)
    path = network_place(file, "NAME.yaml")
    ask_before_overwriting(session, path)
    notes: list[Hint | str] = []
    if folder is None:
        bus = session.bus
        title = f"Values of the network {bus.name}"
        found = list(_live(session, path, notes))
        if bus.bitrate is not None and not bus.simulated:
            notes.append(_bit_rate_note(path, bus.bitrate))
        if not found:
            raise NoAnswer(
                "no node answers",
                hint=Hint(Action.CHECK_SETUP, why="check bit rate and supply: {}")
                + Hint(Action.FIND_NODES, why=", {}"),
            )
    else:
        title = f"Values of the files of {folder}"
        found = list(nodes_of_files(Path(folder), path, notes))
    left_out: dict[str, list[str]] = {}
    for node in found:
        left_out.setdefault(node.exported.left_out_note, []).append(str(node.exported.config.node_id))
    notes += (f"{all_nodes(node_ids)}: {note}" for note, node_ids in left_out.items() if note)
    return write_found(session, path, file, title, found, notes)


def _live(session: SessionNodes, path: Path, notes: list[Hint | str]) -> Iterator[FoundNode]:
    """Yield every answering node; reports nodes that are present but do not answer."""
    unnamed: list[Node] = []
    described: list[Node] = []
    ids = list(_ids(session, notes))
    tell_unknown_bit_rate(session, len(ids))
    silent = _look_ahead(session, ids)
    for node_id in ids:
        try:
            if node_id in silent:
                raise silent[node_id]
            node = session.node(node_id)
            if file := session.base.eds:
                hint = Hint(Action.ADD_EDS, {"file": file}, "{} describes the nodes of its identity only")
                refuse_unlike_file(node_id, node.unlike_file, force=session.options.force, hint=hint)
            held = dict(node.known_pdos())
            found = exported_node(session, node, held, path)
        except (NoAnswer, SdoProtocolError, SdoAborted) as failed:
            if session.base.nodes:
                raise
            notes.append(f"node {node_id} is left out: {failed.text}")
            continue
        (unnamed if node.dictionary is None else described).append(node)
        yield FoundNode(found, held, node.read_cache)
    if unnamed:
        who = all_nodes(node.node_id for node in unnamed)
        words = f"{who}: no EDS, so objects are written as numbers; "
        notes.append(add_eds(unnamed, words, " adds it to the library; then import again"))

    kinds = {(told["vendor"], told["product"]) for told in (node.identity() for node in described)}
    if session.base.eds and len(kinds) > 1:
        who = all_nodes(node.node_id for node in described)
        notes.append(f"{Path(session.base.eds).name} describes {who}, whose identities (0x1018) differ")


def _look_ahead(session: SessionNodes, ids: Sequence[int]) -> dict[int, DvtcliError]:
    """Read *ids* ahead, in parallel if nothing else runs; returns the failures.

    Other read errors are raised later, at their use.
    """
    nodes: list[Node] = []
    silent: dict[int, DvtcliError] = {}
    for node_id in ids:
        try:
            nodes.append(session.node(node_id))
        except (NoAnswer, SdoProtocolError, SdoAborted) as failed:
            silent[node_id] = failed

    def read(node: ReadableNode) -> None:
        with suppress(DvtcliError):
            exported(node, node.pdos(), node.read_cache, all_of(node.dictionary))

    for fault in session.bus.side_by_side([partial(read, node) for node in nodes]):
        raise fault
    return silent


def _ids(session: SessionNodes, notes: list[Hint | str]) -> Iterator[int]:
    if session.base.nodes:
        yield from session.base.nodes
        return
    for row in find_nodes(session).rows:
        if row.note:
            notes.append(f"node {row.node} is left out: {row.note}")
        else:
            yield row.node

"""A network as it is, or as a folder of EDS files has it, as a network file. Writes nothing to a node."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.described_node import FileValues
from dvtcli.device.quirks.standard_channel import in_standard_order
from dvtcli.device.read_pdos import WHATEVER, present_pdos, read_identity, read_pdo
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.several import several
from dvtcli.errors import DvtcliError, NoAnswer, SdoAborted, SdoProtocolError, UsageError
from dvtcli.files.dcf.device_keys import is_read_out
from dvtcli.files.device_file import DEVICE_SUFFIXES, read_device_file
from dvtcli.files.lost_values import must_tell_values
from dvtcli.files.profile.library import profile_of
from dvtcli.operations.exchange.export_network import network_place
from dvtcli.operations.exchange.exported_node import beside, exported_node
from dvtcli.operations.exchange.exported_pdos import exported
from dvtcli.operations.exchange.listed_files import listed_files, nodelist_in
from dvtcli.operations.exchange.written_network import FoundNode, write_found
from dvtcli.operations.nodes.find_nodes import find_nodes
from dvtcli.operations.opening.simulated_nodes import read_dictionary
from dvtcli.operations.session.save_script import ask_before_overwriting
from dvtcli.operations.wanted.unknown_bit_rate import tell_unknown_bit_rate

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.pdo import PdoConfig
    from dvtcli.domain.ports import SdoReader
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


@dataclass(frozen=True, slots=True)
class _Described:
    """A node as its EDS, DCF, XDD or XDC, *path*, has it."""

    path: Path
    node_id: int
    dictionary: ObjectDictionary
    profile: DeviceProfile
    #: what a nodelist calls it
    name: str = ""

    @property
    def title(self) -> str:
        """What the device is called in its nodelist, else in its file."""
        return self.name or self.dictionary.info.product_name or self.profile.title

    @property
    def values(self) -> SdoReader:
        """What the file says that the node holds."""
        return in_standard_order(FileValues(self.dictionary, self.node_id), self.profile)

    def identity(self) -> dict[str, int | None]:
        """What the file says of 0x1018, or of the device as a whole."""
        info = self.dictionary.info.identity
        told = {name: info[name] for name in ("vendor", "product")}
        return {name: told[name] or read_identity(self.values, sub) for sub, name in enumerate(told, 1)}


def import_network(session: Session, file: str, folder: str | None = None, manager: int | None = None) -> Facts:
    """Write the nodes that answer, and what joins them, to the network file *file*: a scan, or the nodes of `-n`.

    With *folder* its EDS and DCF files instead, which needs no bus: a DCF's node-ID counts, others are numbered. Of a
    nodelist (CiA 306-3) in it, or as *folder*, its nodes and their DCFs. With *manager* what the node of that node-ID
    downloads to its nodes. Asks before it overwrites. NoAnswer where no node answers, UsageError where there is no such
    file or nothing in it, or both are given.
    """
    if manager is not None:
        from dvtcli.operations.exchange.import_manager import import_manager

        if folder is not None:
            raise UsageError(f"{folder} and --from-manager {manager}: the file is made of one of them")
        return import_manager(session, file, manager)
    path = network_place(file, "import {}/NAME.yaml")
    ask_before_overwriting(session, path)
    notes: list[str] = []
    if folder is None:
        title = f"What the network {session.bus.name} held"
        found = list(_live(session, path, notes))
        if not found:
            raise NoAnswer("no node answers", hint="look at bit rate and supply: `doctor`, `scan`")
    else:
        title = f"What the files of {folder} say"
        found = [_of_file(one, path, notes) for one in _described(Path(folder), notes)]
    notes += (f"node {one.exported.wish.node_id}: {note}" for one in found if (note := one.exported.left_out_note))
    return write_found(session, path, file, title, found, notes)


def _live(session: Session, path: Path, notes: list[str]) -> Iterator[FoundNode]:
    """Every node that answers; one that is there and does not is said."""
    unnamed: list[str] = []
    ids = list(_ids(session, notes))
    tell_unknown_bit_rate(session, len(ids))
    silent = _look_ahead(session, ids)
    for node_id in ids:
        try:
            if node_id in silent:
                raise silent[node_id]
            node = session.node(node_id)
            held = dict(node.known_pdos())
            found = exported_node(session, node, held, path)
        except (NoAnswer, SdoProtocolError, SdoAborted) as failed:
            if session.base.nodes:
                raise
            notes.append(f"node {node_id} is left out: {failed.text}")
            continue
        if node.dictionary is None:
            unnamed.append(str(node_id))
        yield FoundNode(found, held, _memory(node))
    if unnamed:
        who = f"node {', '.join(unnamed)}"
        notes.append(f"{who}: no EDS is known, objects are numbers; `eds add FILE`, then import again")


def _look_ahead(session: Session, ids: Sequence[int]) -> dict[int, DvtcliError]:
    """Read what is exported of the nodes *ids*, side by side where nothing runs; of those that cannot be met, why not.

    Anything else that cannot be read is told where it is needed.
    """
    nodes: list[Node] = []
    silent: dict[int, DvtcliError] = {}
    for node_id in ids:
        try:
            nodes.append(session.node(node_id))
        except (NoAnswer, SdoProtocolError, SdoAborted) as failed:
            silent[node_id] = failed

    def read(node: Node) -> None:
        with suppress(DvtcliError):
            exported(node, node.pdos(), node.memory)

    for fault in session.bus.side_by_side([partial(read, node) for node in nodes]):
        raise fault
    return silent


def _memory(node: Node) -> SdoReader:
    return node.memory


def _ids(session: Session, notes: list[str]) -> Iterator[int]:
    if session.base.nodes:
        yield from session.base.nodes
        return
    for row in find_nodes(session).rows:
        if row.note:
            notes.append(f"node {row.node} is left out: {row.note}")
        else:
            yield row.node


def _of_file(one: _Described, path: Path, notes: list[str]) -> FoundNode:
    held: dict[Pdo, PdoConfig] = {}
    lacked = _lacked(one)
    if lacked:
        labels = several(pdo.label for pdo in lacked)
        notes.append(f"node {one.node_id}: {labels} left out: no value was read of it when {one.path.name} was made")
    for pdo in present_pdos(one.values, one.dictionary):
        if pdo in lacked:
            continue
        try:
            held[pdo] = read_pdo(one.values, pdo, WHATEVER)
        except SdoAborted:
            continue  # it has neither COB-ID nor mapping: no such PDO
    found = exported(one, held, one.values)
    return FoundNode(replace(found, wish=replace(found.wish, dcf=beside(one.path, path))), held, one.values)


def _lacked(one: _Described) -> list[Pdo]:
    """PDOs that the EDS lists and of which the device told nothing when a DCF was made of it: it may lack them.

    Of files that others made a value that is not there is the default (CiA 306).
    """
    if not is_read_out(one.path):
        return []
    said = {Pdo.at(entry.index) for entry in one.dictionary.entries() if entry.value is not None}
    return [pdo for pdo in present_pdos(one.values, one.dictionary) if pdo not in said]


def _read(path: Path) -> ObjectDictionary:
    """What the file at *path* says, all of it: what it wants becomes the network file's."""
    dictionary = read_dictionary(path)
    must_tell_values(read_device_file(path), str(path))
    return dictionary


def _described(folder: Path, notes: list[str]) -> list[_Described]:
    """The nodes of the EDS and DCF files of *folder*, each with its own node-ID, or the next that is free.

    Where *folder* is a nodelist, or has one, what that names.
    """
    if (nodelist := nodelist_in(folder)) is not None:
        listed = listed_files(nodelist, notes)
        read = [(one, _read(one.path)) for one in listed]
        return [_Described(one.path, one.node_id, held, profile_of(held), one.name) for one, held in read]
    try:
        paths = sorted(one for one in folder.iterdir() if one.suffix.lower() in DEVICE_SUFFIXES)
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
    for path in (path for path in paths if path not in ids):
        free = next((number for number in range(1, 128) if number not in ids.values()), None)
        if free is None:
            raise UsageError(f"{folder} has {len(paths)} files, a network has 127 nodes")
        ids[path] = free
        notes.append(f"{path.name} names no node-ID of its own: it is node {free}")
    found = [_Described(path, ids[path], one, profile_of(one)) for path, one in dictionaries.items()]
    return sorted(found, key=lambda one: one.node_id)

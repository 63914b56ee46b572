"""Nodes of a network as EDS, DCF, XDD and XDC files have them, of a folder or a nodelist. Needs no bus."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.described_node import Defaults, FileValues
from dvtcli.device.quirks.standard_channel import in_standard_order
from dvtcli.device.read_pdos import WHATEVER, present_pdos, read_identity, read_pdo
from dvtcli.domain.network.network_state import CONSUMER_HEARTBEAT
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.several import join_some, plural
from dvtcli.errors import SdoAborted, UsageError
from dvtcli.files.dcf.device_keys import is_read_out
from dvtcli.files.device_file import DEVICE_SUFFIXES, read_device_file
from dvtcli.files.lost_values import must_tell_values
from dvtcli.files.profile.library import profile_of
from dvtcli.operations.exchange.exported_node import beside
from dvtcli.operations.exchange.exported_objects import exported_behaviours, values_of
from dvtcli.operations.exchange.exported_pdos import exported
from dvtcli.operations.exchange.listed_files import listed_files, nodelist_in
from dvtcli.operations.exchange.written_network import FoundNode
from dvtcli.operations.opening.simulated_nodes import read_dictionary

if TYPE_CHECKING:
    from dvtcli.domain.network.wanted_state import NodeWish
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.pdo import PdoConfig
    from dvtcli.domain.ports import SdoReader
    from dvtcli.domain.profile import DeviceProfile


@dataclass(frozen=True, slots=True)
class _FileNode:
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


def nodes_of_files(folder: Path, path: Path, notes: list[str]) -> Iterator[FoundNode]:
    """The nodes of the EDS and DCF files of *folder*, as the network file *path* has them; what is left out is noted.

    UsageError where there is nothing in it.
    """
    for node in _described(folder, notes):
        yield _of_file(node, path, notes)


def _of_file(one: _FileNode, path: Path, notes: list[str]) -> FoundNode:
    held: dict[Pdo, PdoConfig] = {}
    lacked = _lacked(one)
    if lacked:
        labels = join_some(pdo.label for pdo in lacked)
        notes.append(f"node {one.node_id}: {labels} left out: no value was read of it when {one.path.name} was made")
    for pdo in present_pdos(one.values, one.dictionary):
        if pdo in lacked:
            continue
        try:
            held[pdo] = read_pdo(one.values, pdo, WHATEVER)
        except SdoAborted:
            continue  # it has neither COB-ID nor mapping: no such PDO
    said = values_of(one.dictionary)
    found = exported(one, held, one.values, said)
    behaviours = exported_behaviours(one.values, one.dictionary, said)
    wish = replace(found.wish, dcf=beside(one.path, path), objects=(*found.wish.objects, *behaviours))
    notes += _not_taken(one, wish)
    return FoundNode(replace(found, wish=wish), held, one.values)


def _not_taken(one: _FileNode, wish: NodeWish) -> Iterator[str]:
    """How many values that can be set *one* has besides those in *wish*: a network file is no whole device."""
    taken = {f"{value.index:04X}:{value.sub_index:02X}" for value in wish.objects}
    taken |= {value.object.text for value in wish.values}
    pins = {group.index for group in one.profile.vpdo.values()}
    left = [
        entry
        for entry in one.dictionary.entries()
        if entry.value is not None and entry.access.writable and Pdo.at(entry.index) is None
        and entry.object not in taken and entry.index not in {*pins, CONSUMER_HEARTBEAT}
    ]  # fmt: skip
    if not left:
        return
    defaults = Defaults(one.dictionary, one.node_id)
    unlike = [entry.object for entry in left if _default(defaults, entry) != entry.initial(one.node_id)]
    which = f"{len(unlike)} not as by default ({join_some(unlike)})" if unlike else "all as by default"
    yield (
        f"node {one.node_id}: {plural(len(left), 'other value')} of {one.path.name} left out, {which}: "
        "apply that file itself to write what of it is configuration"
    )


def _default(defaults: Defaults, entry: OdEntry) -> bytes | None:
    try:
        return defaults.told(entry.index, entry.sub_index)
    except SdoAborted:
        return None


def _lacked(one: _FileNode) -> list[Pdo]:
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


def _described(folder: Path, notes: list[str]) -> list[_FileNode]:
    """The nodes of the EDS and DCF files of *folder*, each with its own node-ID, or the next that is free.

    Where *folder* is a nodelist, or has one, what that names.
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
    for path in (path for path in paths if path not in ids):
        free = next((number for number in range(1, 128) if number not in ids.values()), None)
        if free is None:
            raise UsageError(f"{folder} has {len(paths)} files, a network has 127 nodes")
        ids[path] = free
        notes.append(f"{path.name} names no node-ID of its own: it is node {free}")
    found = [
        _FileNode(path, ids[path], file_dictionary, profile_of(file_dictionary))
        for path, file_dictionary in dictionaries.items()
    ]
    return sorted(found, key=lambda node: node.node_id)

"""What a file says that a whole device held: a DCF, an EDS, an XDD or XDC, or a backup's JSON lines. Asks no device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.described_node import ToldValues
from dvtcli.device.read_pdos import IDENTITY
from dvtcli.domain.abort import Abort
from dvtcli.errors import SdoAborted, UsageError
from dvtcli.files.whole_device_file import SUFFIX, KeptObject, read_whole_device
from dvtcli.operations.whole_device.device_suffix import holds_values

if TYPE_CHECKING:
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.profile import ObjectAddress
    from dvtcli.operations.user.reporter import Reporter

_COB_ID_FLAGS, _COB_ID_BYTES = 0xE000_0000, 4


@dataclass(frozen=True, slots=True)
class HeldDevice:
    """What a device held by *name*, a file: *objects* by their place, those of node *node_id* (None: it is not said).

    *identity* are the numbers of 0x1018, None where they are not said; *dictionary* describes the objects, if any does.
    """

    name: str
    node_id: int | None
    identity: Mapping[str, int | None]
    objects: Mapping[ObjectAddress, KeptObject]
    dictionary: ObjectDictionary | None = None
    #: all objects of a file that only describes: it has no value of any, but what a device comes up with
    assumed: frozenset[ObjectAddress] = frozenset()
    #: what the file says of values and nobody reads, each with its line
    unread: tuple[str, ...] = ()

    def says(self, place: ObjectAddress) -> bool:
        """Whether it says itself what the object at *place* holds, not what a device comes up with anyway."""
        kept = self.objects.get(place)
        return kept is not None and kept.data is not None and place not in self.assumed

    def maps(self, place: ObjectAddress) -> bool:
        """Whether it says itself that the mapping entry at *place* maps something: 0 is nothing."""
        return self.says(place) and any(self.objects[place].data or b"")

    def on_node(self, place: ObjectAddress, entry: OdEntry | None, node_id: int) -> bytes | None:
        """What the object would hold on *node_id*: what follows the node-ID does so; None where it is not said."""
        kept = self.objects.get(place)
        data = None if kept is None else kept.data
        own = None if self.dictionary is None else self.dictionary.entry(*place)
        if own is not None and own.value is not None and own.value_relative:
            return own.initial(node_id)
        if data is None or entry is None or self.node_id in (None, node_id) or not entry.default_relative:
            return data
        return _moved(data, replace(entry, value=None), self.node_id or 0, node_id)


@dataclass(frozen=True, slots=True)
class KeptIdentity(ToldValues):
    """Who the device was that *held* is about, as the device tells it itself (0x1018)."""

    held: HeldDevice

    def told(self, index: int, sub_index: int) -> bytes:
        """A number of the identity; SdoAborted for one that is not said, and for all else."""
        numbers = dict(enumerate(("vendor", "product", "revision", "serial"), 1))
        number = self.held.identity.get(numbers.get(sub_index, "")) if index == IDENTITY else None
        if number is None:
            raise SdoAborted(index, sub_index, Abort.NO_SUB_INDEX)
        return number.to_bytes(4, "little")


def _moved(data: bytes, entry: OdEntry, from_id: int, to_id: int) -> bytes:
    """*data* of an object whose default follows the node-ID, on another node; bits 29 to 31 of a COB-ID are its own."""
    usual, there = entry.initial(from_id), entry.initial(to_id)
    if usual is None or there is None or len(data) != len(usual):
        return data
    mask = _COB_ID_FLAGS if len(data) == _COB_ID_BYTES else 0
    held, default = int.from_bytes(data, "little"), int.from_bytes(usual, "little")
    if held & ~mask != default & ~mask:
        return data
    return (int.from_bytes(there, "little") & ~mask | held & mask).to_bytes(len(data), "little")


def held_by(file: str, node_id: int | None = None) -> HeldDevice:
    """What *file* says; where it says no node-ID itself, of a node with *node_id*.

    A DCF or XDC says nothing of an object without a value; an EDS, an XDD, and one without any value, the defaults.
    UsageError where it cannot be read, InputFileError where it is none of these files, or a value in it is unreadable.
    """
    try:
        if file.lower().endswith(SUFFIX):
            kept = read_whole_device(Path(file))
            return HeldDevice(file, kept.node_id, kept.identity, kept.objects)
        return _described(file, node_id)
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed


def told_of(file: str, tell: Reporter) -> HeldDevice:
    """As `held_by`, and *tell* gets what of the file's values nobody reads."""
    held = held_by(file)
    for text in held.unread:
        tell.warning(text)
    return held


def _described(file: str, node_id: int | None) -> HeldDevice:
    from dvtcli.files.device_file import must_not_be_cut, read_device_file
    from dvtcli.files.lost_values import must_tell_values
    from dvtcli.files.unread_values import unread_values

    read = read_device_file(Path(file))
    must_not_be_cut(read)
    must_tell_values(read, file)
    dictionary = read.dictionary
    info = dictionary.info
    own_id = info.node_id or node_id
    objects: dict[ObjectAddress, KeptObject] = {}
    assumed = set()
    has_values = holds_values(file) and any(entry.value is not None for entry in dictionary.entries())
    for entry in dictionary.entries():
        if (entry.value is not None or not has_values) and (data := _said(entry, own_id)) is not None:
            kind = "" if entry.data_type is None else entry.data_type.short
            objects[entry.index, entry.sub_index] = KeptObject(data, type_name=kind)
            if not has_values:
                assumed.add((entry.index, entry.sub_index))
    identity = {**info.identity, "serial": None}
    unread = unread_values(read, file) if holds_values(file) else ()
    return HeldDevice(file, own_id, identity, objects, dictionary, frozenset(assumed), unread)


def _said(entry: OdEntry, node_id: int | None) -> bytes | None:
    """ParameterValue; without one the default of what can be written, since a device comes up with that."""
    if entry.value is None and not (entry.access.writable and entry.access.readable):
        return None
    relative = entry.value_relative if entry.value is not None else entry.default_relative
    return None if relative and node_id is None else entry.initial(node_id or 0)

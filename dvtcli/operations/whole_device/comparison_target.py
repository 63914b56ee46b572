"""What a file is compared with: what a node holds of what the file says, or what another file says."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dvtcli.device.read_whole import Unread, named_itself
from dvtcli.domain.configuration import Configuration, configuration_of
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.standard_objects import is_pdo_mapping
from dvtcli.files.eds.written_values import same_value
from dvtcli.files.whole_device_file import KeptObject
from dvtcli.operations.whole_device.export_dcf import why_unread
from dvtcli.operations.whole_device.held_device import HeldDevice, KeptIdentity
from dvtcli.operations.whole_device.object_kind import DifferenceKind, entry_of, kind_of
from dvtcli.operations.whole_device.read_whole_device import configuration, read_entries

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.read_whole import ReadObject
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.profile import DeviceProfile, ObjectAddress
    from dvtcli.operations.session.session import Session

#: bit 31 of a COB-ID: the PDO does not exist
_OFF = 0x8000_0000


@dataclass(frozen=True, slots=True)
class SecondSide:
    """The side that a file is compared with: *name*, and what its objects hold on *node_id*."""

    name: str
    node_id: int
    objects: Mapping[ObjectAddress, KeptObject]
    known: Configuration
    dictionary: ObjectDictionary | None
    identity: Mapping[str, int | None]
    changing: frozenset[ObjectAddress] = frozenset()
    assumed: frozenset[ObjectAddress] = frozenset()

    def entry(self, place: ObjectAddress) -> OdEntry:
        """How the object at *place* is described."""
        return entry_of(self.dictionary, place)

    def kind(self, entry: OdEntry) -> DifferenceKind:
        """What a difference of the object that *entry* describes means; what changes by itself is no setting."""
        return DifferenceKind.APART if (entry.index, entry.sub_index) in self.changing else kind_of(self.known, entry)

    def why_apart(self, entry: OdEntry) -> str:
        """Why the object that *entry* describes is no setting, in words that follow its name."""
        if (entry.index, entry.sub_index) in self.changing:
            return "changes by itself"
        return str(self.known.why_not(entry) or "")


def side_of_node(session: Session, node: Node, first: HeldDevice) -> SecondSide:
    """What *node* holds of what *first* says."""
    dictionary = node.dictionary or first.dictionary
    known = Configuration(node.profile) if dictionary is None else configuration(node, dictionary)
    said = {place for place, kept in first.objects.items() if kept.data is not None}
    named = said - first.assumed
    entries = [entry_of(dictionary, place) for place in sorted({*said, *_beside(said, dictionary)})]
    entries = [
        named_itself(read_entry) if (read_entry.index, read_entry.sub_index) in named else read_entry
        for read_entry in entries
    ]

    def again(one: ReadObject) -> bool:
        wanted = first.on_node(one.place, one.entry, node.node_id)
        return one.place in said and not same_value(one.entry.data_type, wanted, one.data)

    read = read_entries(session, node, entries, known, again)
    objects = {
        place: KeptObject(looked_object.data, why_unread(looked_object))
        for place, looked_object in read.items()
        if looked_object.unread in (None, Unread.SILENT)
        or kind_of(known, looked_object.entry) is DifferenceKind.SETTING
    }
    changing = frozenset(place for place, looked_entry in read.items() if looked_entry.changes)
    name = f"node {node.node_id}"
    return _knowing(SecondSide(name, node.node_id, objects, known, dictionary, node.identity(), changing), first)


def side_of_file(session: Session, second: HeldDevice, first: HeldDevice) -> SecondSide:
    """What *second* says, described by what it leads to itself, else by what *first* does."""
    dictionary = second.dictionary or first.dictionary or _known_by_identity(session, second, first)
    profile = _profile(second if second.identity["vendor"] else first)
    known = Configuration(profile) if dictionary is None else configuration_of(dictionary, profile)
    node_id = second.node_id or first.node_id or 0
    side = SecondSide(second.name, node_id, second.objects, known, dictionary, second.identity, assumed=second.assumed)
    return _knowing(side, first)


def _knowing(second: SecondSide, first: HeldDevice) -> SecondSide:
    """*second*, which knows what enabled RPDOs of either side take: that is no setting."""
    taken = frozenset([*_taken({**second.objects, **first.objects}), *_taken(second.objects)])
    return replace(second, known=replace(second.known, taken=taken))


def _taken(objects: Mapping[ObjectAddress, KeptObject]) -> Iterator[ObjectAddress]:
    """What the enabled RPDOs among *objects* take."""
    words = {
        place: int.from_bytes(kept_object.data, "little")
        for place, kept_object in objects.items()
        if kept_object.data is not None
    }
    for (index, sub_index), word in words.items():
        pdo = Pdo.at(index)
        if pdo is None or pdo.is_tpdo or index != pdo.mapping_index:
            continue
        is_enabled = not words.get((pdo.communication_index, 1), _OFF) & _OFF
        if is_enabled and 0 < sub_index <= words.get((index, 0), 0):
            yield word >> 16, word >> 8 & 0xFF


def _beside(said: Collection[ObjectAddress], dictionary: ObjectDictionary | None) -> Iterator[ObjectAddress]:
    """What decides what the objects that are *said* mean: counts of mappings, and what RPDOs take."""
    mappings = {index for index, _ in said if is_pdo_mapping(index)}
    for entry in () if dictionary is None else dictionary.entries():
        pdo = Pdo.at(entry.index)
        if pdo is not None and (not pdo.is_tpdo or (entry.index in mappings and not entry.sub_index)):
            yield entry.index, entry.sub_index


def _known_by_identity(session: Session, *held: HeldDevice) -> ObjectDictionary | None:
    """What --eds describes, else the file that the identity of one of *held* leads to, as of a node; None for none."""
    from dvtcli.operations.opening.file_choice import found_file
    from dvtcli.operations.opening.simulated_nodes import file_or_family, read_dictionary

    if session.options.eds is not None:
        return read_dictionary(file_or_family(session.options.eds))
    found = next(filter(None, (found_file(KeptIdentity(device)) for device in held)), None)
    if found is not None and found.note:
        session.tell.note(found.note)
    return None if found is None else read_dictionary(found.path)


def _profile(held: HeldDevice) -> DeviceProfile:
    from dvtcli.files.profile.library import profile_for_identity

    return profile_for_identity(held.identity["vendor"] or 0, held.identity["product"] or 0)

"""A whole device, or a file about one, against another file: by what values mean, not by text. Writes nothing."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING

from dvtcli.device.read_whole import Unread, named_itself
from dvtcli.device.same_device import unlike_before
from dvtcli.domain.configuration import Configuration, NotWritten, configuration_of
from dvtcli.domain.object_dictionary import Access, OdEntry
from dvtcli.domain.pdo import BY_SUB_INDEX, Pdo
from dvtcli.domain.standard_objects import is_pdo_mapping, standard_entry
from dvtcli.errors import UsageError
from dvtcli.files.eds.written_values import same_value
from dvtcli.files.whole_device_file import KeptObject
from dvtcli.operations.meanings.physical_meanings import meanings_of
from dvtcli.operations.results.whole_devices import ObjectDifference, WholeCompared
from dvtcli.operations.whole_device.beyond_count import count_beneath, wants_more
from dvtcli.operations.whole_device.device_suffix import holds_values
from dvtcli.operations.whole_device.export_dcf import why_unread
from dvtcli.operations.whole_device.held_device import HeldDevice, KeptIdentity, held_by, told_of
from dvtcli.operations.whole_device.look_through import configuration, read_entries
from dvtcli.operations.whole_device.meant_nodes import node_of_file, selected_nodes

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.read_whole import ReadObject
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.profile import DeviceProfile, ObjectAddress
    from dvtcli.operations.session.session import Session

#: bit 31 of a COB-ID: the PDO does not exist
_OFF = 0x8000_0000
_COMMUNICATION, _STATES = range(0x1000, 0x2000), (0x1001, 0x1002)


class Kind(Enum):
    """What a difference between two values of an object means."""

    SETTING = "it is configured otherwise"
    ABOUT = "it is another device, or another program"
    APART = "it commands, measures, or changes by itself"


@dataclass(frozen=True, slots=True)
class _Second:
    """The side that a file is compared with: *name*, and what its objects hold on *node_id*."""

    name: str
    node_id: int
    objects: Mapping[ObjectAddress, KeptObject]
    known: Configuration
    dictionary: ObjectDictionary | None
    identity: Mapping[str, int | None]
    changing: frozenset[ObjectAddress] = frozenset()
    assumed: frozenset[ObjectAddress] = frozenset()


def compare_device(
    session: Session, file: str, other: str | None = None, node_id: int | None = None, *, shows_all: bool = False
) -> WholeCompared:
    """Compare what *file* says with the file *other*, or with what node *node_id* holds.

    None is the selected one; without one it is the one whose node-ID the file has. A file is a DCF, an EDS, an XDD,
    an XDC or a backup's `.jsonl`. Of the node what the file says something of is read; an object that differs is read
    again, and if it has changed by then it is told apart. UsageError where a file cannot be read, or no setting could
    be compared; InputFileError where it is none.
    """
    first = told_of(file, session.tell)
    if first.assumed and holds_values(file):
        session.tell.note(f"{file} has no value of any object: its defaults are compared")
    if other is None:
        node = session.node(_meant(session, first) if node_id is None else node_id)
        first = first if first.node_id else held_by(file, node.node_id)
        return _compared(first, _knowing(_live(session, node, first), first), node.node_id, shows_all=shows_all)
    second = held_by(other, first.node_id)
    for text in second.unread:
        session.tell.warning(text)
    return _compared(
        held_by(file, second.node_id), _knowing(_kept(session, second, first), first), None, shows_all=shows_all
    )


def _meant(session: Session, first: HeldDevice) -> int:
    """The node that is meant where the line names none."""
    selected = selected_nodes(session)
    if len(selected) > 1:
        return session.node_id()  # which says that this is about one
    return selected[0] if selected else node_of_file(session, first)


def _knowing(second: _Second, first: HeldDevice) -> _Second:
    """*second*, which knows what enabled RPDOs of either side take: that is no setting."""
    taken = frozenset([*_taken({**second.objects, **first.objects}), *_taken(second.objects)])
    return replace(second, known=replace(second.known, taken=taken))


def _taken(objects: Mapping[ObjectAddress, KeptObject]) -> Iterator[ObjectAddress]:
    """What the enabled RPDOs among *objects* take."""
    words = {place: int.from_bytes(one.data, "little") for place, one in objects.items() if one.data is not None}
    for (index, sub_index), word in words.items():
        pdo = Pdo.at(index)
        if pdo is None or pdo.is_tpdo or index != pdo.mapping_index:
            continue
        is_enabled = not words.get((pdo.communication_index, 1), _OFF) & _OFF
        if is_enabled and 0 < sub_index <= words.get((index, 0), 0):
            yield word >> 16, word >> 8 & 0xFF


def _live(session: Session, node: Node, first: HeldDevice) -> _Second:
    """What *node* holds of what *first* says."""
    dictionary = node.dictionary or first.dictionary
    known = Configuration(node.profile) if dictionary is None else configuration(node, dictionary)
    said = {place for place, kept in first.objects.items() if kept.data is not None}
    named = said - first.assumed
    entries = [entry_of(dictionary, place) for place in sorted({*said, *_beside(said, dictionary)})]
    entries = [named_itself(one) if (one.index, one.sub_index) in named else one for one in entries]

    def again(one: ReadObject) -> bool:
        wanted = first.on_node(one.place, one.entry, node.node_id)
        return one.place in said and not same_value(one.entry.data_type, wanted, one.data)

    read = read_entries(session, node, entries, known, again)
    objects = {
        place: KeptObject(one.data, why_unread(one))
        for place, one in read.items()
        if one.unread in (None, Unread.SILENT) or kind_of(known, one.entry) is Kind.SETTING
    }
    changing = frozenset(place for place, one in read.items() if one.changes)
    return _Second(f"node {node.node_id}", node.node_id, objects, known, dictionary, node.identity(), changing)


def _beside(said: Collection[ObjectAddress], dictionary: ObjectDictionary | None) -> Iterator[ObjectAddress]:
    """What decides what the objects that are *said* mean: counts of mappings, and what RPDOs take."""
    mappings = {index for index, _ in said if is_pdo_mapping(index)}
    for entry in () if dictionary is None else dictionary.entries():
        pdo = Pdo.at(entry.index)
        if pdo is not None and (not pdo.is_tpdo or (entry.index in mappings and not entry.sub_index)):
            yield entry.index, entry.sub_index


def _kept(session: Session, second: HeldDevice, first: HeldDevice) -> _Second:
    dictionary = second.dictionary or first.dictionary or _known_by_identity(session, second, first)
    profile = _profile(second if second.identity["vendor"] else first)
    known = Configuration(profile) if dictionary is None else configuration_of(dictionary, profile)
    node_id = second.node_id or first.node_id or 0
    return _Second(
        second.name, node_id, second.objects, known, dictionary, second.identity, assumed=second.assumed
    )  # fmt: skip


def _known_by_identity(session: Session, *held: HeldDevice) -> ObjectDictionary | None:
    """What --eds describes, else the file that the identity of one of *held* leads to, as of a node; None for none."""
    from dvtcli.operations.opening.file_choice import found_file
    from dvtcli.operations.opening.simulated_nodes import file_or_family, read_dictionary

    if session.options.eds is not None:
        return read_dictionary(file_or_family(session.options.eds))
    found = next(filter(None, (found_file(KeptIdentity(one)) for one in held)), None)
    if found is not None and found.note:
        session.tell.note(found.note)
    return None if found is None else read_dictionary(found.path)


def _profile(held: HeldDevice) -> DeviceProfile:
    from dvtcli.files.profile.library import profile_for_identity

    return profile_for_identity(held.identity["vendor"] or 0, held.identity["product"] or 0)


def entry_of(dictionary: ObjectDictionary | None, place: ObjectAddress) -> OdEntry:
    """How the object at *place* is described: by *dictionary*, else by the standard, else not at all."""
    entry = None if dictionary is None else dictionary.entry(*place)
    if entry is not None:
        return entry
    standard = standard_entry(*place)
    if standard is None:
        return OdEntry(*place, "")
    return OdEntry(*place, "", standard.data_type, standard.access or Access.RW)


def is_setting(why: NotWritten | None) -> bool:
    """Whether an object that is not written for this reason (None: it is) is configured all the same, by somebody."""
    return why is None or why.may_be_setting or why in (NotWritten.FLAGGED, NotWritten.SAFETY)


def kind_of(known: Configuration, entry: OdEntry) -> Kind:
    """What a difference of the object that *entry* describes means; what a PDO is set to counts, fixed or not."""
    if (pdo := Pdo.at(entry.index)) is not None:
        is_parameter = entry.index == pdo.mapping_index or entry.sub_index in BY_SUB_INDEX
        return Kind.SETTING if is_parameter else Kind.APART
    why = known.why_not(entry)
    if is_setting(why):
        return Kind.SETTING
    if why is not NotWritten.READ_ONLY or entry.index in _STATES:
        return Kind.APART
    return Kind.ABOUT if entry.index in _COMMUNICATION or entry.access is Access.CONST else Kind.APART


def _compared(first: HeldDevice, second: _Second, node: int | None, *, shows_all: bool) -> WholeCompared:
    found: dict[Kind, list[ObjectDifference]] = {kind: [] for kind in Kind}
    meanings = meanings_of(second.known.profile, second.dictionary)
    count, unread = 0, list[str]()
    for place in sorted(first.objects.keys() & second.objects.keys()):
        entry, held = entry_of(second.dictionary, place), second.objects[place]
        wanted = first.on_node(place, entry, second.node_id)
        kind = Kind.APART if place in second.changing else kind_of(second.known, entry)
        is_assumed = place in first.assumed or place in second.assumed
        if wanted is None or (held.data is None and (is_assumed or node is None)):
            if kind is Kind.SETTING and (wanted is not None or held.data is not None):
                unread.append(_label(place))
            continue  # a side says nothing of it
        if is_assumed and kind is not Kind.SETTING:
            continue  # what a device comes up with is a setting's only
        if (beneath := count_beneath(place, first.objects, second.objects)) is not None:
            if one := _unmapped(place, first, second, beneath):
                count += 1
                found[kind].append(one)
            continue
        count += kind is Kind.SETTING
        if not same_value(entry.data_type, wanted, held.data):
            name = _name(place, second.dictionary, first.dictionary)
            apart = _why_apart(place, second, entry) if kind is Kind.APART else ""
            silent = held.why if held.data is None else ""
            found[kind].append(
                ObjectDifference(
                    _label(place),
                    name,
                    entry.data_type,
                    wanted,
                    held.data,
                    unread=silent,
                    apart=apart,
                    meaning=meanings.of(*place),
                )
            )
    if not count:
        raise _nothing_compared(first, second)
    return WholeCompared(
        node, first.name, second.name, count, tuple(found[Kind.SETTING]), tuple(found[Kind.ABOUT]),
        tuple(found[Kind.APART]), _unsaid(first, second, node), _unlike(first, second),
        unread=tuple(unread), shows_all=shows_all,
    )  # fmt: skip


def _why_apart(place: ObjectAddress, second: _Second, entry: OdEntry) -> str:
    """Why the object at *place* is no setting, in words that follow its name."""
    return "changes by itself" if place in second.changing else str(second.known.why_not(entry) or "")


def _nothing_compared(first: HeldDevice, second: _Second) -> UsageError:
    """The error of a comparison that no setting was part of: it shows nothing, so it is not called equal."""
    unlike = _unlike(first, second)
    return UsageError(
        f"nothing compared: {first.name} and {second.name} have no setting in common that both say something of",
        place=first.name,
        why=f"another device: {unlike}" if unlike else "",
        hint="is it the whole file, and of that device? `backup FILE` makes one now",
    )


def _unmapped(place: ObjectAddress, first: HeldDevice, second: _Second, count: int) -> ObjectDifference | None:
    """The difference of a mapping entry that one side says, without a count, and that is beyond the other's *count*."""
    sides = (first.objects, second.objects)
    if place in first.assumed | second.assumed or not any(wants_more(place, side) for side in sides):
        return None
    before, after = (side[place].data if wants_more(place, side) else None for side in sides)
    entry = entry_of(second.dictionary, place)
    return ObjectDifference(
        _label(place), _name(place, second.dictionary, first.dictionary), entry.data_type, before, after,
        unread=f"not mapped: the count is {count}",
    )  # fmt: skip


def _name(place: ObjectAddress, *dictionaries: ObjectDictionary | None) -> str:
    """What the first file that describes the object calls it."""
    names = (one.display_name(*place) for one in dictionaries if one is not None)
    return next(filter(None, names), "")


def _unsaid(first: HeldDevice, second: _Second, node: int | None) -> int:
    """How many settings only one side says something of."""
    said, known = ({place for place, one in side.objects.items() if one.data is not None} for side in (first, second))
    if node is not None and second.dictionary is not None:
        known = {(entry.index, entry.sub_index) for entry in second.dictionary.entries() if entry.access.readable}
    one_sided = known - said if node is not None else known ^ said
    return sum(kind_of(second.known, entry_of(second.dictionary, place)) is Kind.SETTING for place in one_sided)


def _unlike(first: HeldDevice, second: _Second) -> str:
    """In which numbers of its identity the device is another one; empty where it is not, or nobody knows."""
    before: dict[str, int | None] = {
        name: number for name, number in first.identity.items() if number and second.identity.get(name)
    }
    return unlike_before(before, {name: second.identity[name] for name in before})


def _label(place: ObjectAddress) -> str:
    return f"{place[0]:04X}:{place[1]:02X}"

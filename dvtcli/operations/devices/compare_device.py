"""Compare a whole device, or its file, with another file, by values instead of text. Writes nothing."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from dvtcli.device.file_fits import unlike_before
from dvtcli.device.read_whole import Unread, named_itself
from dvtcli.domain.configuration import Configuration, configuration_of
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_scalings import NOTHING
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.standard_objects import is_pdo_mapping
from dvtcli.errors import UsageError
from dvtcli.files.device_file import holds_values
from dvtcli.files.eds.numbers import same_value
from dvtcli.files.whole_device_file import KeptObject
from dvtcli.operations.devices.backup_device import configuration, read_entries, why_unread
from dvtcli.operations.devices.held_device import (
    DifferenceKind,
    HeldDevice,
    KeptIdentity,
    entry_of,
    held_by,
    kind_of,
    node_of_file,
    selected_nodes,
    told_of,
)
from dvtcli.operations.results.comparisons import ObjectDifference, WholeCompared
from dvtcli.operations.values.object_values import scalings_of

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.read_whole import ReadObject
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.object_scalings import ObjectScalings
    from dvtcli.domain.profile import DeviceProfile, ObjectAddress
    from dvtcli.domain.scaling import Scaling
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser

#: bit 31 of a COB-ID: the PDO does not exist
_OFF = 0x8000_0000


@dataclass(frozen=True, slots=True)
class SecondSide:
    """The side that a file is compared with: *name*, and the objects on *node_id*."""

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
        """Classify a difference of the object *entry*; a value that changes by itself is not a setting."""
        return DifferenceKind.APART if (entry.index, entry.sub_index) in self.changing else kind_of(self.known, entry)

    def why_apart(self, entry: OdEntry) -> str:
        """Explain, after the object's name, why *entry* is not a setting."""
        if (entry.index, entry.sub_index) in self.changing:
            return "changes by itself"
        return str(self.known.why_not(entry) or "")


def side_of_node(session: SessionNodes, node: Node, first: HeldDevice) -> SecondSide:
    """Read the objects of *first* from *node*."""
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


def side_of_file(session: SessionUser, second: HeldDevice, first: HeldDevice) -> SecondSide:
    """Return *second* as a side, with its own description, else that of *first*."""
    dictionary = second.dictionary or first.dictionary or _known_by_identity(session, second, first)
    profile = _profile(second if second.identity["vendor"] else first)
    known = Configuration(profile) if dictionary is None else configuration_of(dictionary, profile)
    node_id = second.node_id or first.node_id or 0
    side = SecondSide(second.name, node_id, second.objects, known, dictionary, second.identity, assumed=second.assumed)
    return _knowing(side, first)


def _knowing(second: SecondSide, first: HeldDevice) -> SecondSide:
    """Mark as process data what enabled RPDOs of either side receive: no settings."""
    taken = frozenset([*_taken({**second.objects, **first.objects}), *_taken(second.objects)])
    return replace(second, known=replace(second.known, taken=taken))


def _taken(objects: Mapping[ObjectAddress, KeptObject]) -> Iterator[ObjectAddress]:
    """Yield what enabled RPDOs among *objects* receive."""
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
    """Yield objects that decide the meaning of *said*: mapping counts, and objects that RPDOs receive."""
    mappings = {index for index, _ in said if is_pdo_mapping(index)}
    for entry in () if dictionary is None else dictionary.entries():
        pdo = Pdo.at(entry.index)
        if pdo is not None and (not pdo.is_tpdo or (entry.index in mappings and not entry.sub_index)):
            yield entry.index, entry.sub_index


def _known_by_identity(session: SessionUser, *held: HeldDevice) -> ObjectDictionary | None:
    """Return the dictionary of --eds, else by the identity of *held*; None if unknown."""
    from dvtcli.operations.session.device_files import found_file
    from dvtcli.operations.session.simulated_nodes import file_or_family, read_dictionary

    if session.options.eds is not None:
        return read_dictionary(file_or_family(session.options.eds), session.options.chosen_modules)
    found = next(filter(None, (found_file(KeptIdentity(device)) for device in held)), None)
    if found is not None and found.note:
        session.reporter.note(found.note)
    return None if found is None else read_dictionary(found.path, session.options.chosen_modules)


def _profile(held: HeldDevice) -> DeviceProfile:
    from dvtcli.files.profiles import profile_for_identity

    return profile_for_identity(held.identity["vendor"] or 0, held.identity["product"] or 0)


Objects = Mapping["ObjectAddress", "KeptObject"]


def count_beneath(place: ObjectAddress, *sides: Objects) -> int | None:
    """Return the mapping count if *place* is a mapping entry beyond it on all *sides*, else None.

    A side without a count has the others'; the highest counts.
    """
    index, sub_index = place
    if not is_pdo_mapping(index) or not sub_index:
        return None
    counts = [data for side in sides if (data := _data(side, (index, 0))) is not None]
    if not counts or not all(len(data) == 1 and data[0] < sub_index for data in counts):
        return None
    return max(data[0] for data in counts)


def wants_more(place: ObjectAddress, side: Objects) -> bool:
    """Tell whether *side* maps an object in *place* (0: none) but gives no count."""
    return _data(side, (place[0], 0)) is None and any(_data(side, place) or b"")


def _data(side: Objects, place: ObjectAddress) -> bytes | None:
    kept = side.get(place)
    return None if kept is None else kept.data


def compare_device(
    session: SessionNodes, file: str, other: str | None = None, node_id: int | None = None, *, shows_all: bool = False
) -> WholeCompared:
    """Compare *file* with the file *other*, or with the node *node_id*.

    None is the selected node, else the file's node-ID. A file is a DCF, an EDS, an XDD, an XDC or a backup's `.jsonl`.
    Of a node, the objects of the file are read; differing objects are read again, and reported separately if they
    changed. Raises UsageError if a file cannot be read or has no setting to compare; InputFileError for another kind of
    file.
    """
    first = told_of(file, session.reporter)
    if first.assumed and holds_values(file):
        session.reporter.note(f"{file} has no values: its defaults are compared")
    if other is None:
        node = session.node(_meant(session, first) if node_id is None else node_id)
        first = first if first.node_id else held_by(file, node.node_id)
        side = session.read_together(lambda: side_of_node(session, node, first))
        return _compared(first, side, node.node_id, shows_all=shows_all)
    second = held_by(other, first.node_id)
    for text in second.unread:
        session.reporter.warning(text)
    side = side_of_file(session, second, first)
    return _compared(held_by(file, second.node_id), side, None, shows_all=shows_all)


def _meant(session: SessionNodes, first: HeldDevice) -> int:
    """Choose the node if the line names none."""
    selected = selected_nodes(session)
    if len(selected) > 1:
        return session.node_id()  # which says that this is about one
    return selected[0] if selected else node_of_file(session, first)


def _compared(first: HeldDevice, second: SecondSide, node: int | None, *, shows_all: bool) -> WholeCompared:
    scalings = scalings_of(second.known.profile, second.dictionary)
    comparison = _Comparison(first, second, scalings, asks_node=node is not None)
    for place in sorted(first.objects.keys() & second.objects.keys()):
        comparison.look_at(place)
    if not comparison.count:
        raise _nothing_compared(first, second)
    found = comparison.found
    return WholeCompared(
        node, first.name, second.name, comparison.count,
        tuple(found[DifferenceKind.SETTING]), tuple(found[DifferenceKind.ABOUT]),
        tuple(found[DifferenceKind.APART]), _unsaid(first, second, node), _unlike(first, second),
        unread=tuple(comparison.unread), shows_all=shows_all,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Pair:
    """Both values of the object at *place*: *before* and *after*, None if a side has none."""

    place: ObjectAddress
    entry: OdEntry
    kind: DifferenceKind
    before: bytes | None
    after: bytes | None
    is_assumed: bool


@dataclass(slots=True)
class _Comparison:
    """The comparison of *first* and *second*: objects compared, and findings."""

    first: HeldDevice
    second: SecondSide
    scalings: ObjectScalings
    asks_node: bool
    count: int = 0
    found: dict[DifferenceKind, list[ObjectDifference]] = field(
        default_factory=lambda: {kind: [] for kind in DifferenceKind}
    )
    unread: list[str] = field(default_factory=list)

    def look_at(self, place: ObjectAddress) -> None:
        """Compare the object at *place*."""
        pair = self._pair(place)
        if not self._is_said(pair):
            if pair.kind is DifferenceKind.SETTING and (pair.before is not None or pair.after is not None):
                self.unread.append(_label(place))
        elif pair.is_assumed and pair.kind is not DifferenceKind.SETTING:
            pass  # what a device comes up with is a setting's only
        elif (beneath := count_beneath(place, self.first.objects, self.second.objects)) is not None:
            self._look_beyond(pair, beneath)
        else:
            self._look_at_values(pair)

    def _pair(self, place: ObjectAddress) -> _Pair:
        entry = self.second.entry(place)
        return _Pair(
            place, entry, self.second.kind(entry),
            self.first.on_node(place, entry, self.second.node_id), self.second.objects[place].data,
            is_assumed=place in self.first.assumed or place in self.second.assumed,
        )  # fmt: skip

    def _is_said(self, pair: _Pair) -> bool:
        """Tell whether both sides have a value, or a reason for its absence."""
        if pair.before is None:
            return False
        return pair.after is not None or (self.asks_node and not pair.is_assumed)

    def _look_beyond(self, pair: _Pair, count: int) -> None:
        """Compare a mapping entry beyond *count*: different if a side maps an object there without a count."""
        sides = (self.first.objects, self.second.objects)
        if pair.is_assumed or not any(wants_more(pair.place, side) for side in sides):
            return
        before, after = (side[pair.place].data if wants_more(pair.place, side) else None for side in sides)
        self.count += 1
        self._found(pair, before, after, unread=f"not mapped: the count is {count}")

    def _look_at_values(self, pair: _Pair) -> None:
        self.count += pair.kind is DifferenceKind.SETTING
        if same_value(pair.entry.data_type, pair.before, pair.after):
            return
        self._found(
            pair, pair.before, pair.after,
            unread=self.second.objects[pair.place].why if pair.after is None else "",
            apart=self.second.why_apart(pair.entry) if pair.kind is DifferenceKind.APART else "",
            meaning=self.scalings.of(*pair.place),
        )  # fmt: skip

    def _found(
        self, pair: _Pair, before: bytes | None, after: bytes | None, *,
        unread: str = "", apart: str = "", meaning: Scaling = NOTHING,
    ) -> None:  # fmt: skip
        name, data_type = _name(pair.place, self.second.dictionary, self.first.dictionary), pair.entry.data_type
        found = ObjectDifference(_label(pair.place), name, data_type, before, after, unread, apart, meaning)
        self.found[pair.kind].append(found)


def _nothing_compared(first: HeldDevice, second: SecondSide) -> UsageError:
    """Make the error of a comparison without settings: nothing compared is not equal."""
    config_differences = _unlike(first, second)
    return UsageError(
        f"nothing compared: {first.name} and {second.name} have no setting in common",
        place=first.name,
        why=f"another device: {config_differences}" if config_differences else "",
        hint=Hint(Action.BACKUP, why="is the file complete, and for that device? {} makes a backup now"),
    )


def _name(place: ObjectAddress, *dictionaries: ObjectDictionary | None) -> str:
    """Return the object's name in the first file that describes it."""
    names = (dictionary.display_name(*place) for dictionary in dictionaries if dictionary is not None)
    return next(filter(None, names), "")


def _unsaid(first: HeldDevice, second: SecondSide, node: int | None) -> int:
    """Count settings with a value on a single side."""
    said, known = (
        {place for place, kept_object in side.objects.items() if kept_object.data is not None}
        for side in (first, second)
    )
    if node is not None and second.dictionary is not None:
        known = {(entry.index, entry.sub_index) for entry in second.dictionary.entries() if entry.access.readable}
    one_sided = known - said if node is not None else known ^ said
    return sum(second.kind(second.entry(place)) is DifferenceKind.SETTING for place in one_sided)


def _unlike(first: HeldDevice, second: SecondSide) -> str:
    """Name the numbers of the identity that differ; empty if none, or unknown."""
    before: dict[str, int | None] = {
        name: number for name, number in first.identity.items() if number and second.identity.get(name)
    }
    return unlike_before(before, {name: second.identity[name] for name in before})


def _label(place: ObjectAddress) -> str:
    return f"{place[0]:04X}:{place[1]:02X}"

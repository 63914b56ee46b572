"""A device's file (DCF, EDS, XDD, XDC, backup): its kind, its values, and the nodes it is for."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.described_node import KnownValues
from dvtcli.device.read_pdos import read_modules
from dvtcli.domain.abort import Abort
from dvtcli.domain.configuration import Configuration, NotWritten
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.object_dictionary import Access, OdEntry
from dvtcli.domain.objects import COMMUNICATION_AREA, IDENTITY
from dvtcli.domain.pdo import BY_SUB_INDEX, Pdo
from dvtcli.domain.standard_objects import standard_entry
from dvtcli.errors import SdoAborted, UsageError
from dvtcli.files.device_file import holds_values
from dvtcli.files.whole_device_file import SUFFIX, KeptObject, read_whole_device
from dvtcli.operations.values.named_objects import is_name, object_at

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.profile import ObjectAddress, Range
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import Reporter

_COB_ID_FLAGS, _COB_ID_BYTES = 0xE000_0000, 4


class HeldDevice(NamedTuple):
    """The values of a device in a file *name*: *objects* by address, of node *node_id* (None: not given).

    *identity* has the numbers of 0x1018, None if not given; *dictionary* describes the objects, if known.
    """

    name: str
    node_id: int | None
    identity: Mapping[str, int | None]
    objects: Mapping[ObjectAddress, KeptObject]
    dictionary: ObjectDictionary | None = None
    #: all objects of a file without values: defaults only
    assumed: frozenset[ObjectAddress] = frozenset()
    #: values in the file without use, with their lines
    unread: tuple[str, ...] = ()

    def says(self, place: ObjectAddress) -> bool:
        """Tell whether the file itself has a value at *place*, not only a default."""
        kept = self.objects.get(place)
        return kept is not None and kept.data is not None and place not in self.assumed

    def maps(self, place: ObjectAddress) -> bool:
        """Tell whether the file itself maps an object in the mapping entry *place*: 0 is none."""
        return self.says(place) and any(self.objects[place].data or b"")

    def on_node(self, place: ObjectAddress, entry: OdEntry | None, node_id: int) -> bytes | None:
        """Return the object's value on *node_id*, adjusted if it follows the node-ID; None if not given."""
        kept = self.objects.get(place)
        data = None if kept is None else kept.data
        own = None if self.dictionary is None else self.dictionary.entry(*place)
        if own is not None and own.value is not None and own.value_relative:
            return own.initial(node_id)
        if data is None or entry is None or self.node_id in (None, node_id) or not entry.default_relative:
            return data
        return _moved(data, replace(entry, value=None), self.node_id or 0, node_id)


@dataclass(frozen=True, slots=True)
class KeptIdentity(KnownValues):
    """The identity (0x1018) in *held*, readable like a device's."""

    held: HeldDevice

    def known_value(self, index: int, sub_index: int) -> bytes:
        """Return a number of the identity; raises SdoAborted for missing numbers and other objects."""
        numbers = dict(enumerate(("vendor", "product", "revision", "serial"), 1))
        number = self.held.identity.get(numbers.get(sub_index, "")) if index == IDENTITY else None
        if number is None:
            raise SdoAborted(index, sub_index, Abort.NO_SUB_INDEX)
        return number.to_bytes(4, "little")


def unlike_modules(held: HeldDevice, node: ReadableNode) -> str:
    """Describe how the modules in *held* differ from the module list (0x1027) of *node*; empty if they do not."""
    if held.dictionary is None or not held.dictionary.info.modules.connected:
        return ""
    return held.dictionary.info.modules.unlike(read_modules(node.read_cache), f"{held.name} has modules", node.node_id)


def _moved(data: bytes, entry: OdEntry, from_id: int, to_id: int) -> bytes:
    """Adjust *data*, whose default follows the node-ID, to another node; bits 29 to 31 of a COB-ID stay."""
    usual, there = entry.initial(from_id), entry.initial(to_id)
    if usual is None or there is None or len(data) != len(usual):
        return data
    mask = _COB_ID_FLAGS if len(data) == _COB_ID_BYTES else 0
    held, default = int.from_bytes(data, "little"), int.from_bytes(usual, "little")
    if held & ~mask != default & ~mask:
        return data
    return (int.from_bytes(there, "little") & ~mask | held & mask).to_bytes(len(data), "little")


def held_by(file: str, node_id: int | None = None) -> HeldDevice:
    """Read *file*; a file without a node-ID is read for *node_id*.

    A DCF or XDC without a value has no value for the object; an EDS, an XDD, and files without any value have defaults.
    Raises UsageError if it cannot be read, InputFileError for another kind of file or an unreadable value.
    """
    try:
        if file.lower().endswith(SUFFIX):
            kept = read_whole_device(Path(file))
            return HeldDevice(file, kept.node_id, kept.identity, kept.objects)
        return _described(file, node_id)
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed


def told_of(file: str, reporter: Reporter) -> HeldDevice:
    """Read *file* like `held_by`; *reporter* gets its unused values."""
    held = held_by(file)
    for text in held.unread:
        reporter.warning(text)
    return held


def _described(file: str, node_id: int | None) -> HeldDevice:
    from dvtcli.files.device_file import must_not_be_cut, read_device_file
    from dvtcli.files.unread_values import must_tell_values, unread_values

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
    """Return ParameterValue, else the default of a writable object, as devices boot with it."""
    if entry.value is None and not (entry.access.writable and entry.access.readable):
        return None
    relative = entry.value_relative if entry.value is not None else entry.default_relative
    return None if relative and node_id is None else entry.initial(node_id or 0)


def refuse_kind(file: str) -> None:
    """Raises UsageError if *file* has no device's values by its suffix."""
    if not holds_values(file):
        raise UsageError(
            f"{file} has no values for a device",
            place=file,
            hint=Hint(
                Action.RESTORE,
                why="a DCF, an XDC or a backup (.jsonl) has values; {} loads the device's own defaults",
            ),
        )


def selected_nodes(session: SessionNodes) -> tuple[int, ...]:
    """Return the selected node or the nodes of `-n`; empty if none. Raises UsageError for `-n all`."""
    if session.selected is None and session.base.every_node:
        raise UsageError(
            "a file for one device needs the node to write it to",
            given={"node_id": "all"},
            hint=Hint(Action.GIVE, {"node_id": "3,4,5"}, "names several"),
        )
    if session.selected is None and len(session.base.nodes) > 1:
        return session.base.nodes
    selected = session.selected_id()
    return () if selected is None else (selected,)


def node_of_file(session: SessionNodes, held: HeldDevice) -> int:
    """Return the node-ID of *held*, with a message; raises UsageError if it has none."""
    if held.node_id is None:
        return session.node_id()
    session.reporter.note(f"node {held.node_id}, as in {held.name}")
    return held.node_id


def selected_alone(session: SessionNodes, held: HeldDevice) -> tuple[int, ...]:
    """Return `selected_nodes`; raises UsageError if none, as *held* may be of another device."""
    if found := selected_nodes(session):
        return found
    own = "" if held.node_id is None else f" ({held.name} was made of node {held.node_id})"
    raise UsageError(
        "no node is selected",
        place=held.name,
        hint=Hint(Action.GIVE, {"node_id": f"ID{own}"}, "this writes to the replacement device: {}")
        + Hint(Action.SHOW_NODE, {"node": "ID"}, ", or {}"),
    )


_STATES = (0x1001, 0x1002)


class DifferenceKind(Enum):
    """The kind of a difference between two values."""

    SETTING = "it is configured in another way"
    ABOUT = "it is another device, or another program"
    APART = "it commands, measures, or changes by itself"


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
    """Tell whether an object not written for this reason (None: written) is still configured by somebody."""
    return why is None or why.may_be_setting or why in (NotWritten.FLAGGED, NotWritten.SAFETY)


def kind_of(known: Configuration, entry: OdEntry) -> DifferenceKind:
    """Classify a difference of the object *entry*; PDO parameters count, fixed or not."""
    if (pdo := Pdo.at(entry.index)) is not None:
        is_parameter = entry.index == pdo.mapping_index or entry.sub_index in BY_SUB_INDEX
        return DifferenceKind.SETTING if is_parameter else DifferenceKind.APART
    why = known.why_not(entry)
    if is_setting(why):
        return DifferenceKind.SETTING
    if why is not NotWritten.READ_ONLY or entry.index in _STATES:
        return DifferenceKind.APART
    is_about_device = entry.index in COMMUNICATION_AREA or entry.access is Access.CONST
    return DifferenceKind.ABOUT if is_about_device else DifferenceKind.APART


@dataclass(frozen=True, slots=True)
class Included:
    """A *word* of `include`: all sub-indices in *range*, or the single *object*."""

    word: str
    range: Range | None = None
    object: ObjectAddress | None = None

    @property
    def is_many(self) -> bool:
        """Tell whether it is a range of indices, whose objects are unknown."""
        return self.range is not None and self.range[0] != self.range[1]

    def of(self, held: HeldDevice) -> list[ObjectAddress]:
        """List its addresses with a value in *held*."""
        said = held.objects.keys() - held.assumed
        if self.range is None:
            return [place for place in said if place == self.object]
        return sorted(place for place in said if self.range[0] <= place[0] <= self.range[1])


def included_of(node: NodeDescription, held: HeldDevice, words: Collection[str]) -> tuple[Included, ...]:
    """Resolve *words* in *held*; raises UsageError for an unknown object, or if the file has no value."""
    found = tuple(_included(node, word) for word in words)
    for included in found:
        if not included.is_many and not included.of(held):
            raise UsageError(
                f"matches no value of {held.name}",
                given={"include": included.word},
                node=node.node_id,
                hint=Hint(
                    Action.PLAN,
                    {"file": held.name},
                    "lists the values of the file that are not written; INDEX, INDEX:SUB, or 2000-2FFF",
                ),
            )
    return found


def idle(held: HeldDevice, known: Configuration, included: Collection[Included]) -> Iterator[Hint]:
    """Report entries of *included* without effect: objects written anyway, or never."""
    for inclusion in included:
        places = inclusion.of(held)
        if not places:
            yield Hint(Action.GIVE, {"include": inclusion.word}, f"matches nothing in {verbatim(held.name)}")
        elif not inclusion.is_many and (text := _why_idle(known, places)):
            yield Hint(Action.GIVE, {"include": inclusion.word}, f"{{}}: {verbatim(text)}")


def _why_idle(known: Configuration, places: Collection[ObjectAddress]) -> str:
    """Explain why including *places* has no effect; empty if it has."""
    if all(Pdo.at(index) is not None for index, _ in places):
        return "a PDO's, which is written without it"
    dictionary = known.dictionary
    own = known.without_included()
    whys = [own.why_not_unread(entry_of(dictionary, place)) for place in places] if dictionary else []
    if not whys or any(why is not None and why.is_lifted_by_include for why in whys):
        return ""
    never = next((why for why in whys if why not in (None, NotWritten.READ_ONLY)), None)
    if never is None and None in whys:
        return "it is written without it"
    return f"it is not written nevertheless: it {never or NotWritten.READ_ONLY}"


def _included(node: NodeDescription, word: str) -> Included:
    first, dash, last = word.partition("-")
    if dash:
        try:
            low, high = int(first, 16), int(last, 16)
        except ValueError:
            low, high = 1, 0
        if not 0x1000 <= low <= high <= 0xFFFF:
            raise UsageError("a range of indices is written 2000-2FFF", given={"include": word})
        return Included(word, (low, high))
    index, sub_index = object_at(node, word)
    if ":" in word or (is_name(word) and sub_index):
        return Included(word, object=(index, sub_index))
    return Included(word, (index, index))

"""Read a device's object dictionary in one pass: the value of each object, or why it is missing. Writes nothing."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

from dvtcli.domain.abort import Abort
from dvtcli.domain.configuration import Configuration, NotWritten
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import Access, ObjectType, OdEntry
from dvtcli.domain.objects import DEVICE_TYPE, IDENTITY, PROGRAM_DATA
from dvtcli.domain.standard_objects import standard_entry, standard_object_type
from dvtcli.errors import NoAnswer, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.ports import SdoReader
    from dvtcli.domain.profile import ObjectAddress

#: told of each object before it is read: index, sub-index, how many of how many were read, seconds left (None: unknown)
OnObject = Callable[[int, int, int, int, float | None], None]
#: what all objects together may hold (bytes); beyond that the rest is left unread
MOST_BYTES = 16 << 20
_REFUSED_ON_SCAN = 0x02
_DEVICE_TYPE = (DEVICE_TYPE, 0)
#: device type and identity: no value of a device that runs changes them
_FIXED = (DEVICE_TYPE, IDENTITY)
#: the operating system's channels, from which each upload takes something (CiA 301)
_CHANNELS = range(0x1023, 0x1027)
#: how long is waited before a second look: what a device measures anew, it does within that (s)
PAUSE_S = 0.1
#: a pace is known once this many objects were read
_PACE_FROM = 20


class Unread(StrEnum):
    """The reason not to read an object."""

    WRITE_ONLY = "write-only"
    FLAGGED = "not to be read on a scan (ObjFlags, bit 1)"
    PASSCODE = "part of a login"
    PROGRAM = "a program"
    CHANNEL = "an upload would take something from it"
    TOO_MUCH = "more than 16 MiB were read before it"
    SILENT = "no answer"


@dataclass(frozen=True, slots=True)
class ReadObject:
    """The result of reading *entry*: *data*, the device's *abort* code, or why it was not read.

    *changes*: a second read gave another value.
    """

    entry: OdEntry
    data: bytes | None = None
    abort: int | None = None
    unread: Unread | None = None
    changes: bool = False

    @property
    def place(self) -> ObjectAddress:
        """The object's index and sub-index."""
        return self.entry.index, self.entry.sub_index


def read_whole(
    node: Node,
    entries: Iterable[OdEntry],
    known: Configuration,
    *,
    again: Callable[[ReadObject], bool] = lambda _read: False,
    on_object: OnObject = lambda *_progress: None,
    around: Callable[[OdEntry], AbstractContextManager[None]] = lambda _entry: nullcontext(),
) -> dict[ObjectAddress, ReadObject]:
    """Read *entries* of *node* once, and twice if *again* is true for an entry.

    Objects that are write-only, flagged against reading, or secret by *known* are skipped; their result is an abort.
    What only a restart changes (0x1000, 0x1018) is not read again if it was read since. Each upload runs within
    *around*. Does not detect a restart meanwhile (`read_together` does). Raises NoAnswer if the node falls silent.
    """
    found = {read_object.place: read_object for read_object in (_judged(entry, known) for entry in entries)}
    reading = _DeviceReading(node, on_object, around)
    reading.read(found, [place for place, one in found.items() if one.unread is None])
    twice = [place for place, one in found.items() if one.data is not None and again(one)]
    if twice:
        node.bus.sleep(PAUSE_S)
    second = {place: replace(found[place], data=None) for place in twice}
    reading.read(second, twice, anew=True)
    for place, one in second.items():
        found[place] = replace(found[place], changes=one.data != found[place].data)
    return found


def named_itself(entry: OdEntry) -> OdEntry:
    """*entry* marked as named in a file with a value: reading it is not a scan."""
    return replace(entry, object_flags=entry.object_flags & ~_REFUSED_ON_SCAN)


def values_of(found: Mapping[ObjectAddress, ReadObject]) -> dict[ObjectAddress, bytes]:
    """The values read that did not change meanwhile."""
    return {place: one.data for place, one in found.items() if one.data is not None and not one.changes}


def _judged(entry: OdEntry, known: Configuration) -> ReadObject:
    """*entry*, with the reason not to read it."""
    why = None
    if not entry.access.readable:
        why = Unread.WRITE_ONLY
    elif entry.object_flags & _REFUSED_ON_SCAN:
        why = Unread.FLAGGED
    elif known.why_not(entry) is NotWritten.PASSCODE:
        why = Unread.PASSCODE
    elif entry.index == PROGRAM_DATA and entry.sub_index:
        why = Unread.PROGRAM
    elif entry.index in _CHANNELS:
        why = Unread.CHANNEL
    return ReadObject(entry, unread=why)


@dataclass(slots=True)
class _DeviceReading:
    """The settings for reading a *node*."""

    node: Node
    on_object: OnObject
    around: Callable[[OdEntry], AbstractContextManager[None]]

    def read(
        self, found: dict[ObjectAddress, ReadObject], places: Collection[ObjectAddress], *, anew: bool = False
    ) -> None:
        """Read the objects at *places* into *found*; *anew*: none of them from the read cache."""
        now_s = self.node.bus.now_s
        since_s, size = now_s(), 0
        for number, place in enumerate(places):
            left_s = (now_s() - since_s) / number * (len(places) - number) if number >= _PACE_FROM else None
            self.on_object(*place, number, len(places), left_s)
            one = found[place]
            is_fixed = place[0] in _FIXED and not anew
            if size > MOST_BYTES:
                one = replace(one, unread=Unread.TOO_MUCH)
            else:
                one = self._asked(one, self.node.read_cache if is_fixed else self.node.sdo)
            size += len(one.data or b"")
            found[place] = one

    def _asked(self, one: ReadObject, reader: SdoReader) -> ReadObject:
        try:
            with self.around(one.entry):
                return replace(one, data=reader.upload(*one.place))
        except SdoAborted as aborted:
            return replace(one, abort=aborted.code)
        except NoAnswer:
            self.node.sdo.upload(*_DEVICE_TYPE)  # the node is there, and silent about this object
            return replace(one, unread=Unread.SILENT)


#: communication, the maker's own, device profiles (CiA 301, 7.4.1)
AREAS = (range(0x1000, 0xA000),)
#: a device that is silent this often about what it lacks cannot be read through
_MOST_SILENT = 3
_HIGHEST = 0xFE
#: aborts of objects that are there
_IS_THERE = (
    Abort.WRITE_ONLY, Abort.UNSUPPORTED_ACCESS, Abort.HARDWARE, Abort.NO_DATA, Abort.LOCAL_CONTROL, Abort.DEVICE_STATE
)  # fmt: skip


def scan_objects(
    node: ReadableNode,
    known: Configuration,
    areas: tuple[range, ...] = AREAS,
    on_object: OnObject = lambda *_progress: None,
) -> dict[ObjectAddress, ReadObject]:
    """Ask *node* for each index in *areas*, and for the sub-indices of existing objects.

    Skips programs, OS command channels, and login objects by *known*. Does not detect a restart meanwhile
    (`read_together` does). Raises NoAnswer if the node does not answer for missing objects.
    """
    scan = _Scan(node, known)
    indices = [index for area in areas for index in area if index not in _CHANNELS and index != PROGRAM_DATA]
    since_s = node.bus.now_s()
    for number, index in enumerate(indices):
        pace_s = (node.bus.now_s() - since_s) / number if number >= _PACE_FROM else None
        on_object(index, 0, number, len(indices), None if pace_s is None else pace_s * (len(indices) - number))
        scan.ask_index(index)
    return scan.found


class _Scan:
    """A scan of *node* with the objects *found* so far."""

    def __init__(self, node: ReadableNode, known: Configuration) -> None:
        self._node, self._known = node, known
        self.found: dict[ObjectAddress, ReadObject] = {}
        self._silent = self._size = 0

    def ask_index(self, index: int) -> None:
        """Read sub-index 0, and the others if sub-index 0 may be their number."""
        first = self._ask(index, 0)
        if first is None or first.data is None or len(first.data) != 1 or not first.data[0]:
            return
        if standard_object_type(index) is ObjectType.VAR or self._ask(index, 1) is None:
            return
        for sub_index in range(2, min(first.data[0], _HIGHEST) + 1):
            self._ask(index, sub_index)

    def _ask(self, index: int, sub_index: int) -> ReadObject | None:
        """Read one object into *found*; None if missing."""
        entry = _entry(index, sub_index)
        one: ReadObject | None = ReadObject(entry)
        if self._known.why_not(entry) is NotWritten.PASSCODE:
            one = ReadObject(entry, unread=Unread.PASSCODE)
        elif self._size > MOST_BYTES:
            one = ReadObject(entry, unread=Unread.TOO_MUCH)
        else:
            one = self._read(entry)
        if one is not None:
            self.found[index, sub_index] = one
        return one

    def _read(self, entry: OdEntry) -> ReadObject | None:
        try:
            data = self._node.sdo.upload(entry.index, entry.sub_index)
        except SdoAborted as aborted:
            return ReadObject(entry, abort=aborted.code) if aborted.code in _IS_THERE else None
        except NoAnswer as silent:
            self._silent += 1
            if self._silent >= _MOST_SILENT or not self.found:
                silent.hint = Hint(
                    Action.GIVE_EDS, why="this device does not report missing objects; reading it needs its EDS: {}"
                )
                raise
            return ReadObject(entry, unread=Unread.SILENT)
        self._size += len(data)
        return ReadObject(entry, data)


def _entry(index: int, sub_index: int) -> OdEntry:
    """The standard's description of an object without an EDS; anything is possible outside the standard."""
    standard = standard_entry(index, sub_index)
    if standard is None:
        return OdEntry(index, sub_index, "")
    return OdEntry(index, sub_index, "", standard.data_type, standard.access or Access.RW)

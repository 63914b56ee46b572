"""Scan a device without an EDS: its objects, index by index, and their values. Writes nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.device.read_whole import MOST_BYTES, ReadObject, Unread
from dvtcli.domain.abort import Abort
from dvtcli.domain.configuration import NotWritten
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import Access, ObjectType, OdEntry
from dvtcli.domain.standard_objects import standard_entry, standard_object_type
from dvtcli.errors import NoAnswer, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.device.read_whole import OnObject
    from dvtcli.domain.configuration import Configuration
    from dvtcli.domain.profile import ObjectAddress

#: communication, the maker's own, device profiles (CiA 301, 7.4.1)
AREAS = (range(0x1000, 0xA000),)
_CHANNELS, _PROGRAM = range(0x1023, 0x1027), 0x1F50
#: a device that is silent this often about what it lacks cannot be read through
_MOST_SILENT = 3
_PACE_FROM = 20
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
    indices = [index for area in areas for index in area if index not in _CHANNELS and index != _PROGRAM]
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
                    Action.GIVE_EDS, why="a device that does not say what it lacks can only be read by its EDS: {}"
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

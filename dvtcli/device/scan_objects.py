"""A device that no file describes: which objects it answers for, index by index, and what they hold.

Reads, and writes nothing. Does not know what an object means, but for the standard's.
"""

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
    from dvtcli.device.node import Node
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
    node: Node, known: Configuration, areas: tuple[range, ...] = AREAS, on_object: OnObject = lambda *_progress: None
) -> dict[ObjectAddress, ReadObject]:
    """Ask *node* for each index of *areas*, and for the sub-indices of those that it has.

    Programs, the operating system's channels and what *known* says is part of a login are not asked for. Does not
    tell whether the node restarts meanwhile (`read_together` does). NoAnswer if the node says nothing about what it
    lacks.
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
    """What was *found* of *node* so far."""

    def __init__(self, node: Node, known: Configuration) -> None:
        self._node, self._known = node, known
        self.found: dict[ObjectAddress, ReadObject] = {}
        self._silent = self._size = 0

    def ask_index(self, index: int) -> None:
        """Sub-index 0, and the others where it may say how many there are."""
        first = self._ask(index, 0)
        if first is None or first.data is None or len(first.data) != 1 or not first.data[0]:
            return
        if standard_object_type(index) is ObjectType.VAR or self._ask(index, 1) is None:
            return
        for sub_index in range(2, min(first.data[0], _HIGHEST) + 1):
            self._ask(index, sub_index)

    def _ask(self, index: int, sub_index: int) -> ReadObject | None:
        """Read one object into what was found; None where there is none."""
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
    """What the standard says of an object that no file describes; elsewhere anything is possible."""
    standard = standard_entry(index, sub_index)
    if standard is None:
        return OdEntry(index, sub_index, "")
    return OdEntry(index, sub_index, "", standard.data_type, standard.access or Access.RW)

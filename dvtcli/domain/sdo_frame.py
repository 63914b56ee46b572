"""Find values of certain objects in SDO frames (CiA 301, 7.2.4.3).

Covers expedited, segmented and block transfers by any client. An ambiguous frame, such as a segment of an unfinished
block, counts as a value.
"""

from __future__ import annotations

from collections.abc import Set

from dvtcli.domain.ports import Frame

#: CAN-IDs of the default SDO channels
SDO_CAN_IDS = range(0x581, 0x680)
_REQUEST_IDS, _ANSWER_IDS, _BETWEEN = range(0x601, 0x680), range(0x581, 0x600), 0x80
#: command specifiers (bits 7..5) that begin a transfer to the server, or from it; the others go both ways
_DOWNLOAD, _UPLOADED, _SEGMENT, _OF_BLOCKS, _BLOCK = 1, 2, 0, 5, 6
_EXPEDITED, _ENDS_BLOCK, _LAST, _ABORT, _BLOCK_TAKEN = 0x02, 0x01, 0x80, 0x80, 0xA1
#: commands without value: upload, next segment, abort, and block transfer commands; and a server's
_WITHOUT = {
    _DOWNLOAD: frozenset((0x40, 0x60, 0x70, 0x80, 0xA0, 0xA1, 0xA2, 0xA3, 0xA4)),
    _UPLOADED: frozenset((0x20, 0x30, 0x60, 0x80, 0xA0, 0xA1, 0xA2, 0xA4)),
}
#: place of a value: behind the multiplexer, behind the command, or in place of an abort's multiplexer
_OF_NAMED, _OF_PART, _REPEATED = slice(4, 8), slice(1, 8), slice(1, 4)

Objects = Set[tuple[int, int]]


class SdoValues:
    """Track the SDO transfers of a bus to find frames with values of *objects*.

    *unknown* tells whether a segment counts if its transfer began before tracking.
    """

    def __init__(self, objects: Objects, *, unknown: bool = False) -> None:
        self._objects = objects
        self._unknown = unknown
        self._ways: dict[int, _Way] = {}

    def value_in(self, frame: Frame) -> slice | None:
        """Bytes of *frame*, the next frame on the bus, that are such a value or its checksum; None for none."""
        requests, answers = frame.can_id in _REQUEST_IDS, frame.can_id in _ANSWER_IDS
        if not (requests or answers) or frame.extended or frame.remote or not frame.data:
            return None
        found = self._way(frame.can_id, _DOWNLOAD if requests else _UPLOADED).value_in(frame.data)
        other = self._ways.get(frame.can_id + (-_BETWEEN if requests else _BETWEEN))
        if other is not None and other.answered(frame.data):
            found = _REPEATED
        return found if found is not None and frame.data[found] else None

    def without(self, frame: Frame) -> tuple[Frame, bool]:
        """*frame*, the next frame on the bus, with zeros in place of such a value; and whether it carried one."""
        found = self.value_in(frame)
        if found is None:
            return frame, False
        data = bytearray(frame.data)
        data[found] = bytes(len(data[found]))
        return frame._replace(data=bytes(data)), True

    def _way(self, can_id: int, begins: int) -> _Way:
        if can_id not in self._ways:
            self._ways[can_id] = _Way(self._objects, begins, unknown=self._unknown)
        return self._ways[can_id]


class _Way:
    """One direction between client and server; *begins* is the specifier that names an object and brings data."""

    def __init__(self, objects: Objects, begins: int, *, unknown: bool) -> None:
        self._objects = objects
        self._begins = begins
        #: whether the last begun transfer concerns the objects; also after its end, as it may be repeated
        self._counts = unknown
        #: next segment's number in a block transfer (0: none), and whether the last segment was received
        self._next, self._is_last = 0, False
        #: the frame that began the block: repeated before any segment, it begins the block again
        self._beginning = b""
        #: whether a frame ended the block transfer
        self._over = False
        #: first bytes of past segments: a server that takes a segment for a request aborts and repeats them
        self._parts: set[bytes] = set()

    def value_in(self, data: bytes) -> slice | None:
        """Bytes of *data* that are a value of the objects; None for none."""
        found = self._found(data)
        if found is _OF_PART:
            self._parts.add(data[_REPEATED])
        return found

    def answered(self, data: bytes) -> bool:
        """Process *data* of the other side; whether it aborts a part as if the part named an object.

        A frame outside block transfers ends the block.
        """
        if data[0] >> 5 != _OF_BLOCKS or data[0] == _BLOCK_TAKEN:
            self._over = True
        return data[0] == _ABORT and data[_REPEATED] in self._parts

    def _found(self, data: bytes) -> slice | None:
        command = data[0]
        if self._in_block(data):
            self._next, self._is_last = (command & 0x7F) + 1, bool(command & _LAST)
            return _OF_PART if self._counts else self._of_named(data)
        if command == _ABORT:
            self._over = True
            return None
        kind = command >> 5
        if self._begins_one(command):
            return self._begun(data, kind)
        if kind == _BLOCK:
            self._next = 0
        if command in _WITHOUT[self._begins]:  # as a device that repeats what it took may not do
            return self._of_named(data) if kind != _OF_BLOCKS and any(data[_OF_NAMED]) else None
        return _OF_PART if self._counts else self._of_named(data)

    def _begins_one(self, command: int) -> bool:
        """Whether *command* names an object whose value follows in this direction."""
        return command >> 5 == self._begins or (command >> 5 == _BLOCK and not command & _ENDS_BLOCK)

    def _begun(self, data: bytes, kind: int) -> slice | None:
        found = self._of_named(data)
        if kind == _BLOCK or not data[0] & _EXPEDITED:
            self._counts, self._over, self._is_last = found is not None, False, False
            self._next, self._beginning = int(kind == _BLOCK), data
        return found

    def _in_block(self, data: bytes) -> bool:
        """Whether a frame is a block segment; during a transfer of the objects every frame but its end is."""
        command, number = data[0], data[0] & 0x7F
        if not self._next or not number or (self._next == 1 and data == self._beginning):
            return False
        if self._counts and not self._over:
            return not (self._is_last and command >> 5 == _BLOCK and command & _ENDS_BLOCK)
        return number in (1, self._next) and not (self._begins_one(command) and self._of_named(data))

    def _of_named(self, data: bytes) -> slice | None:
        named = (int.from_bytes(data[1:3], "little"), data[3]) if len(data) >= _OF_NAMED.start else None
        return _OF_NAMED if named in self._objects else None

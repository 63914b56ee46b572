"""Vector's binary log; reports files that were cut short."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from os import fstat
from pathlib import Path
from typing import Any, BinaryIO

import can
from can.io.blf import BLFParseError

from dvtcli.domain.cob_id import fits
from dvtcli.domain.ports import Frame
from dvtcli.files.recordings.recording_format import NoFrameError, RecordedFrame, RecordingFormat

#: an object's header: signature, the header's size and version, the object's size and type
_OBJECT = struct.Struct("<4sHHLL")
_CONTAINER, _PLAIN, _PACKED = 10, 0, 2
#: a container's own header: compression, and unpacked size
_HEAD = struct.Struct("<H6xL4x")
#: a data frame's whole object: header, clock, time, channel, flags, length, CAN-ID and data
_FRAME = struct.Struct("<4sHHLL LHHQ HBBL8s")
#: types of objects: data frames; those with frames; flags, bits, and the smallest header
_DATA_FRAMES, _WITH_FRAMES, _REMOTE, _EXTENDED, _LEAST = (1, 86), (1, 86, 73, 100, 101), 0x80, 0x8000_0000, 32
#: counts a second of an object's clock, and the last time that is not in doubt (s)
_TEN_US, _COUNTS, _LAST_S = 1, {True: 100_000, False: 1_000_000_000}, 9e10
#: writers begin a new container at 128 KiB; some bytes can hold a thousand times as many
_MOST_BYTES = 16 << 20
#: how often what is in containers may be copied: an object of 1 MB that lies in eight of them is four times
_MOST_COPIES = 16


class Unpacked:
    """A BLF file, unpacked here within a limit, because python-can's reader has none."""

    def __init__(self, raw: BinaryIO) -> None:
        self._raw = raw
        #: type of the object whose header was read last and whose rest comes next
        self._kind: int | None = None
        #: whether the file ends within an object
        self.is_cut = False

    def read(self, count: int) -> bytes:
        """Read the next *count* bytes, containers unpacked. Raises NoFrameError if too many, or fewer than none."""
        if count < 0:
            raise NoFrameError("an object that is shorter than its header")
        if count > _MOST_BYTES:
            raise NoFrameError(f"an object of {count} bytes; writers make them of 128 KiB")
        data = self._raw.read(count)
        if self._kind is not None:
            kind, self._kind = self._kind, None
            self.is_cut |= len(data) < count
            return self._unpacked(data) if kind == _CONTAINER else data
        if count == _OBJECT.size and len(data) == count:
            signature, _, _, _, kind = _OBJECT.unpack(data)
            self._kind = kind if signature == b"LOBJ" else None
        return data

    def _unpacked(self, container: bytes) -> bytes:
        if len(container) < _HEAD.size or _HEAD.unpack_from(container)[0] != _PACKED:
            return container
        unpacking = zlib.decompressobj()
        data = unpacking.decompress(container[_HEAD.size :], _MOST_BYTES + 1)
        if len(data) > _MOST_BYTES:
            raise NoFrameError(f"a container of more than {_MOST_BYTES >> 20} MiB; writers make them of 128 KiB")
        if not unpacking.eof:
            raise NoFrameError("a container that ends before what is packed in it does")
        return _HEAD.pack(_PLAIN, len(data)) + data

    def close(self) -> None:
        """Close the file."""
        self._raw.close()


class _Reader(can.BLFReader):
    """python-can's reader with limits, quicker for data frames; it copies an object once per container it spans."""

    _copied = _taken = 0

    def _parse_container(self, data: bytes) -> Iterator[can.Message]:
        self._copied += len(self._tail)
        self._taken += len(data)
        if len(self._tail) > _MOST_BYTES or self._copied > _MOST_COPIES * self._taken + _MOST_BYTES:
            raise NoFrameError("an object that goes on over too many containers")
        return super()._parse_container(data)

    def _parse_data(self, data: bytes) -> Iterator[Any]:
        """Iterate over the frames in *data*; python-can reads from the first unusual object on."""
        unpack, start_s, size = _FRAME.unpack_from, self.start_timestamp, len(data)
        pos, last = 0, size - _FRAME.size
        while pos <= last:
            mark, _, version, length, kind, clock, _, _, count, channel, flags, dlc, can_id, raw = unpack(data, pos)
            if mark != b"LOBJ":
                if (found := data.find(b"LOBJ", pos, pos + 8)) < 0:
                    break
                pos = found  # behind padding
                continue
            if pos + length > size or length < _LEAST:
                break
            if kind in _DATA_FRAMES:
                is_extended, time_s = can_id >= _EXTENDED, count / _COUNTS[clock == _TEN_US] + start_s
                can_id &= 0x1FFF_FFFF if is_extended else 0x7FFF_FFFF
                is_usual = version == 1 and length >= _FRAME.size and dlc <= 8 and not flags & _REMOTE
                if not is_usual or not 0 <= time_s <= _LAST_S or not fits(can_id, extended=is_extended):
                    break
                yield RecordedFrame(Frame(can_id, raw[:dlc], is_extended, False, time_s), str(channel - 1))
            elif kind in _WITH_FRAMES or version not in (1, 2):
                break
            pos += length
        short = _short_object(data, pos)
        try:
            yield from super()._parse_data(data[pos:short])
        finally:
            self._pos += pos
        if short is not None:
            raise NoFrameError("an object that is shorter than its header")

    @property
    def is_cut(self) -> bool:
        """Whether an object began that the file does not end."""
        begun = self._tail.lstrip(b"\0")[:4]
        return begun != b"" and b"LOBJ".startswith(begun)


def _short_object(data: bytes, pos: int) -> int | None:
    """The position of the first object from *pos* on that is shorter than its header: python-can never gets past it."""
    while (found := data.find(b"LOBJ", pos, pos + 8)) >= 0 and found + _OBJECT.size <= len(data):
        length = _OBJECT.unpack_from(data, found)[3]
        if length < _OBJECT.size:
            return found
        pos = found + length
    return None


class BlfFormat(RecordingFormat):
    """Vector's .blf; holds a block back until full or closed."""

    suffix = ".blf"
    title = "Vector binary"
    appends = True
    rotates = True
    broken = (*RecordingFormat.broken, BLFParseError, zlib.error)

    def source(self, raw: BinaryIO, _path: Path) -> Any:
        """Return the file itself, for its size."""
        return raw

    def reader(self, source: Any) -> Iterator[can.Message | RecordedFrame]:
        """Iterate over frames; raises NoFrameError after the last if the file was cut short."""
        unpacked, size = Unpacked(source), fstat(source.fileno()).st_size
        blocks = _Reader(unpacked)  # type: ignore[arg-type]
        yield from blocks
        if size < blocks.file_size:
            raise NoFrameError(f"it was cut short: of {blocks.file_size} bytes it has {size}")
        if unpacked.is_cut or blocks.is_cut:
            raise NoFrameError("it was cut short: its last object is not complete")

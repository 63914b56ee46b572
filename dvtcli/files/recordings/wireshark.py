"""Captures of CAN frames as by Wireshark and tcpdump: reads pcapng and pcap, writes pcapng."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import can

from dvtcli.files.recordings.recording_format import RecordingFormat


class PcapFormat(RecordingFormat):
    """tcpdump's .pcap."""

    suffix = ".pcap"
    title = "tcpdump"
    is_written = False
    tells = True

    def source(self, raw: BinaryIO, _path: Path) -> Any:
        """The file itself."""
        return raw

    def reader(self, source: Any) -> Iterator[can.Message]:
        """Iterate over frames among the packets; the first bytes tell pcap from pcapng."""
        return read_capture(source)


class PcapngFormat(PcapFormat):
    """Wireshark's .pcapng."""

    suffix = ".pcapng"
    title = "Wireshark"
    is_written = True
    flushes = True

    def writer(self, path: Path, *, append: bool, most_bytes: int) -> Any:  # noqa: ARG002 - it declares neither
        """Return a writer of one interface's frames to *path*."""
        return PcapngWriter(path)


_CAN, _COOKED, _COOKED_2 = 227, 113, 276
#: header of a cooked capture: position of the protocol, and length
_COOKED_HEADS = {_COOKED: (14, 16), _COOKED_2: (0, 20)}
_CAN_PROTOCOLS = (0x000C, 0x000D)
_EXTENDED, _REMOTE, _ERROR, _ID = 1 << 31, 1 << 30, 1 << 29, 0x1FFF_FFFF
_FD, _MOST_BYTES, _MOST_FD_BYTES = 0x04, 8, 64
#: maximum length of a block or packet
_MOST = 16 << 20
_SECTION, _INTERFACE, _PACKET, _SIMPLE, _ENHANCED = 0x0A0D0D0A, 1, 2, 3, 6
_ORDER_MARK = 0x1A2B3C4D
_NAME, _RESOLUTION, _OFFSET = 2, 9, 14
#: maximum exponent of 2 or 10 for ticks per second, within the 64 bits of a time
_FINEST = {2: 63, 10: 19}
#: ticks per second of a pcap, by its first number
_TICKS = {0xA1B2C3D4: 10**6, 0xA1B23C4D: 10**9}


class _Interface(NamedTuple):
    """An interface of a capture: *ticks* per second, times counted from *begin_s*."""

    link: int
    name: str = ""
    ticks: int = 10**6
    begin_s: int = 0
    most: int = 0


class _Packet(NamedTuple):
    """A packet received by an interface; *length* is the length on the wire."""

    interface: _Interface
    time_s: float
    data: bytes
    length: int


def read_capture(file: BinaryIO) -> Iterator[can.Message]:
    """Iterate over CAN frames of *file*, a pcapng or a pcap, in order; other packets are left out.

    Raises ValueError if the file is neither, is damaged, or has packets but no frame of CAN or CAN FD.
    """
    others: Counter[int] = Counter()
    found = False
    for packet in _packets(file):
        message = _message(packet)
        if message is None:
            others[packet.interface.link] += 1
        else:
            found = True
            yield message
    if others and not found:
        links = ", ".join(map(str, sorted(others)))
        raise ValueError(f"{others.total()} packets, none of them a frame of CAN or CAN FD (link type {links})")


def _packets(file: BinaryIO) -> Iterator[_Packet]:
    head = _read(file, 4)
    if head == struct.pack("<I", _SECTION):
        return _Blocks(file).packets()
    for order in "<>":
        ticks = _TICKS.get(struct.unpack(f"{order}I", head)[0])
        if ticks is not None:
            return _of_pcap(file, order, ticks)
    raise ValueError("its first bytes are those of no capture")


def _of_pcap(file: BinaryIO, order: str, ticks: int) -> Iterator[_Packet]:
    _, _, _, _, _, link = struct.unpack(f"{order}HHiIII", _read(file, 20))
    interface = _Interface(link & 0x0FFF_FFFF, ticks=ticks)
    while head := file.read(16):
        seconds, parts, kept, length = struct.unpack(f"{order}IIII", _complete(head, 16))
        yield _Packet(interface, seconds + parts / ticks, _read(file, _bounded(kept)), length)


@dataclass(slots=True)
class _Blocks:
    """The blocks of a pcapng *file* after its first number; each section has its own byte *order* and interfaces."""

    file: BinaryIO
    order: str = "<"
    interfaces: list[_Interface] = field(default_factory=list)
    #: the time of the last packet: a simple one has none
    time_s: float = 0.0

    def packets(self) -> Iterator[_Packet]:
        """Iterate over the packets of all sections."""
        self._begin_section()
        while head := self.file.read(4):
            kind = int.from_bytes(_complete(head, 4), "little" if self.order == "<" else "big")
            if kind == _SECTION:
                self._begin_section()
                continue
            packet = self._understood(kind, self._body(*self._numbers("I", _read(self.file, 4))))
            if packet is not None:
                self.time_s = packet.time_s
                yield packet

    def _numbers(self, form: str, data: bytes) -> tuple[int, ...]:
        """Unpack the numbers at the beginning of *data*. Raises struct.error if too short."""
        return struct.unpack_from(self.order + form, data)

    def _begin_section(self) -> None:
        """Read a section header, which gives the byte order of all numbers, including its own length."""
        length, mark = _read(self.file, 4), _read(self.file, 4)
        for self.order in "<>":
            if self._numbers("I", mark)[0] == _ORDER_MARK:
                break
        else:
            raise ValueError("a section begins without its byte order")
        self._body(self._numbers("I", length)[0], had=12)
        self.interfaces.clear()

    def _body(self, length: int, had: int = 8) -> bytes:
        """Read the rest of a block of *length* bytes after *had* bytes; its end repeats the length."""
        if length % 4 or length < had + 4:
            raise ValueError(f"a block says that it is {length} bytes long")
        body = _read(self.file, _bounded(length) - had)
        if self._numbers("I", body[-4:])[0] != length:
            raise ValueError(f"the end of a block of {length} bytes says another length")
        return body[:-4]

    def _understood(self, kind: int, body: bytes) -> _Packet | None:
        if kind == _INTERFACE:
            self.interfaces.append(self._interface(body))
        elif kind == _ENHANCED:
            number, high, low, kept, length = self._numbers("IIIII", body)
            return self._packet(number, (high, low), body[20:], kept, length)
        elif kind == _PACKET:
            number, _, high, low, kept, length = self._numbers("HHIIII", body)
            return self._packet(number, (high, low), body[20:], kept, length)
        elif kind == _SIMPLE:
            (length,) = self._numbers("I", body)
            interface = self._of(0)
            kept = min(length, interface.most or length)
            return _Packet(interface, self.time_s, _cut(body[4:], kept), length)
        return None

    def _of(self, number: int) -> _Interface:
        if number >= len(self.interfaces):
            raise ValueError(f"a packet of interface {number}, of which nothing was said")
        return self.interfaces[number]

    def _packet(self, number: int, at: tuple[int, int], data: bytes, kept: int, length: int) -> _Packet:
        interface = self._of(number)
        whole_s, ticks = divmod(at[0] << 32 | at[1], interface.ticks)
        return _Packet(interface, whole_s + interface.begin_s + ticks / interface.ticks, _cut(data, kept), length)

    def _interface(self, body: bytes) -> _Interface:
        link, _, most = self._numbers("HHI", body)
        options = dict(self._options(body[8:]))
        resolution = options.get(_RESOLUTION, b"\6")[0]
        base, power = 2 if resolution & 0x80 else 10, resolution & 0x7F
        if power > _FINEST[base]:
            raise ValueError(f"an interface whose clock ticks {base}^{power} times a second")
        offset = options.get(_OFFSET, bytes(8))
        name = options.get(_NAME, b"").decode("utf-8", "replace") or str(len(self.interfaces))
        (begin_s,) = self._numbers("q", offset)
        return _Interface(link, name, base**power, begin_s, most)

    def _options(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        at = 0
        while at + 4 <= len(data):
            code, length = self._numbers("HH", data[at : at + 4])
            if not code:
                return
            yield code, _cut(data[at + 4 :], length)
            at += 4 + length + -length % 4


def _message(packet: _Packet) -> can.Message | None:
    """Return the frame in *packet*; None if not CAN or CAN FD. Raises ValueError if cut off."""
    data, link = packet.data, packet.interface.link
    if link in _COOKED_HEADS:
        at, length = _COOKED_HEADS[link]
        if int.from_bytes(_cut(data, length)[at : at + 2], "big") not in _CAN_PROTOCOLS:
            return None
        data = data[length:]
    elif link != _CAN:
        return None
    word, length, flags = struct.unpack_from(">IBB", data)
    if length > _MOST_FD_BYTES:  # CAN XL has another head, in which this byte is 0x80 at least
        return None
    is_error = bool(word & _ERROR)
    is_remote = bool(word & _REMOTE) and not is_error
    return can.Message(
        timestamp=packet.time_s,
        arbitration_id=word & _ID,
        is_extended_id=bool(word & _EXTENDED),
        is_remote_frame=is_remote,
        is_error_frame=is_error,
        is_fd=bool(flags & _FD) or length > _MOST_BYTES,
        data=None if is_remote else _cut(data[8:], length),
        dlc=length,
        channel=packet.interface.name,
    )


def _bounded(length: int) -> int:
    if length > _MOST:
        raise ValueError(f"a part of {length} bytes; none is longer than {_MOST}")
    return length


def _read(file: BinaryIO, length: int) -> bytes:
    return _complete(file.read(length), length)


def _complete(data: bytes, length: int) -> bytes:
    if len(data) < length:
        raise ValueError("it ends in the middle")
    return data


def _cut(data: bytes, length: int) -> bytes:
    """Return the first *length* bytes of *data*."""
    return _complete(data[:length], length)


class PcapngWriter:
    """Writes CAN messages to *path* as a pcapng with one interface, times in ns. Raises OSError on failure."""

    def __init__(self, path: Path) -> None:
        self.file = path.open("wb")
        self._block(_SECTION, struct.pack("<IHHq", _ORDER_MARK, 1, 0, -1))
        options = struct.pack("<HH4sHHB3xI", _NAME, 4, b"can0", _RESOLUTION, 1, 9, 0)
        self._block(_INTERFACE, struct.pack("<HHI", _CAN, 0, 0) + options)

    def on_message_received(self, message: can.Message) -> None:
        """Write a message."""
        word = message.arbitration_id | (_EXTENDED if message.is_extended_id else 0)
        word |= _REMOTE if message.is_remote_frame else 0
        data = b"" if message.is_remote_frame else bytes(message.data)
        packet = struct.pack(">IBBBB", word, message.dlc, 0, 0, 0) + data
        whole_s, part_s = divmod(message.timestamp, 1)
        time_ns = int(whole_s) * 10**9 + round(part_s * 10**9)
        head = struct.pack("<IIIII", 0, time_ns >> 32, time_ns & 0xFFFF_FFFF, len(packet), len(packet))
        self._block(_ENHANCED, head + packet + bytes(-len(packet) % 4))

    def _block(self, kind: int, body: bytes) -> None:
        length = struct.pack("<I", 12 + len(body))
        self.file.write(struct.pack("<I", kind) + length + body + length)

    def stop(self) -> None:
        """Close the file."""
        self.file.close()

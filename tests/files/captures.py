"""Captures made by the tests themselves: pcapng and pcap of either byte order, cut into blocks as programs do."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from dvtcli.domain.ports import Frame

CAN, COOKED, COOKED_2, ETHERNET = 227, 113, 276, 1


def socketcan(frame: Frame, *, flags: int = 0, error: bool = False) -> bytes:
    """*frame* as LINKTYPE_CAN_SOCKETCAN has it."""
    word = frame.can_id | frame.extended << 31 | frame.remote << 30 | error << 29
    return struct.pack(">IBB2x", word, len(frame.data), flags) + frame.data


def cooked(data: bytes, link: int, protocol: int = 0x000C) -> bytes:
    """*data* behind the head that *link* has."""
    if link == COOKED:
        return struct.pack(">HHH8sH", 0, 280, 0, bytes(8), protocol) + data
    return struct.pack(">HHIHBB8s", protocol, 0, 3, 280, 0, 0, bytes(8)) + data if link == COOKED_2 else data


@dataclass(frozen=True)
class Style:
    """How a capture is written: *resolution* is its if_tsresol, None for none, *offset_s* its if_tsoffset."""

    order: str = "<"
    link: int = CAN
    kind: str = "enhanced"
    resolution: int | None = 9
    offset_s: int = 0
    sections: int = 1

    @property
    def ticks(self) -> int:
        """Ticks a second."""
        code = 6 if self.resolution is None else self.resolution
        return int(2 ** (code & 0x7F) if code & 0x80 else 10**code)


def block(order: str, kind: int, body: bytes) -> bytes:
    body += bytes(-len(body) % 4)
    length = struct.pack(f"{order}I", len(body) + 12)
    return struct.pack(f"{order}I", kind) + length + body + length


def option(order: str, code: int, data: bytes) -> bytes:
    return struct.pack(f"{order}HH", code, len(data)) + data + bytes(-len(data) % 4)


def section(style: Style) -> bytes:
    """A section's head and its one interface, with a comment and a block that nobody knows."""
    order = style.order
    options = option(order, 1, b"made by a test") + option(order, 2, b"can7")
    if style.resolution is not None:
        options += option(order, 9, bytes([style.resolution]))
    if style.offset_s:
        options += option(order, 14, struct.pack(f"{order}q", style.offset_s))
    head = block(order, 0x0A0D0D0A, struct.pack(f"{order}IHHq", 0x1A2B3C4D, 1, 0, -1))
    unknown = block(order, 0x0BAD, b"something else")
    return head + block(order, 1, struct.pack(f"{order}HHI", style.link, 0, 0) + options + bytes(4)) + unknown


def packet(style: Style, data: bytes, time_s: float) -> bytes:
    order, ticks = style.order, round((time_s - style.offset_s) * style.ticks)
    if style.kind == "simple":
        return block(order, 3, struct.pack(f"{order}I", len(data)) + data)
    if style.kind == "old":
        head = struct.pack(f"{order}HHIIII", 0, 0, ticks >> 32, ticks & 0xFFFFFFFF, len(data), len(data))
        return block(order, 2, head + data)
    head = struct.pack(f"{order}IIIII", 0, ticks >> 32, ticks & 0xFFFFFFFF, len(data), len(data))
    return block(order, 6, head + data + bytes(-len(data) % 4) + option(order, 2, b"\0\0\0\1") + bytes(4))


def pcapng(frames: Sequence[Frame], style: Style) -> bytes:
    """*frames* as a pcapng in that *style*, in so many sections."""
    parts = [section(style)]
    for number, frame in enumerate(frames):
        if number and style.sections > 1 and number % style.sections == 0:
            parts.append(section(style))
        parts.append(packet(style, cooked(socketcan(frame), style.link), frame.timestamp_s))
    return b"".join(parts)


def pcap(frames: Sequence[Frame], order: str, *, nanoseconds: bool, link: int = CAN) -> bytes:
    """*frames* as a pcap."""
    ticks, magic = (10**9, 0xA1B23C4D) if nanoseconds else (10**6, 0xA1B2C3D4)
    parts = [struct.pack(f"{order}IHHiIII", magic, 2, 4, 0, 0, 65535, link)]
    for frame in frames:
        data = cooked(socketcan(frame), link)
        seconds, part = divmod(round(frame.timestamp_s * ticks), ticks)
        parts.append(struct.pack(f"{order}IIII", seconds, part, len(data), len(data)) + data)
    return b"".join(parts)

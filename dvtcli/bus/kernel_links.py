"""The CAN links of Linux from its kernel over rtnetlink: kind, up or down, bit rate, bus-off.

Read-only; needs no rights and no tool. Empty on other systems.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator
from dataclasses import dataclass

#: rtnetlink's messages (linux/rtnetlink.h), and the flag of a request for all links
_NEW_LINK, _GET_LINK, _ERROR, _DONE, _ALL = 16, 18, 2, 3, 0x301
#: attributes of a link (linux/if_link.h), and of a CAN controller inside its INFO_DATA (linux/can/netlink.h)
_NAME, _LINK_INFO, _INFO_KIND, _INFO_DATA, _BIT_TIMING, _STATE, _MODE = 3, 18, 1, 2, 1, 4, 5
#: a controller's mode (linux/can/netlink.h, struct can_ctrlmode): a mask, then flags
_FLAGS, _LISTEN_ONLY = 4, 0x02
#: Linux's hardware type CAN, the flag of a link that is up, and a controller's state bus-off
_ARPHRD_CAN, _IFF_UP, _BUS_OFF = 280, 1, 3
_HEADER, _LINK, _ATTRIBUTE = struct.Struct("=IHHII"), struct.Struct("=BxHiII"), struct.Struct("=HH")
#: time-out for the kernel's answer (s), which normally comes at once
_PATIENCE_S = 1.0
#: default bit rate (bit/s), used by most CANopen networks
_USUAL_BIT_RATE = 500_000


@dataclass(frozen=True, slots=True)
class KernelLink:
    """A link in `ip link`: *kind* is "can" for a controller, "vcan" or "vxcan" for a link without wire.

    *bit_rate* is in bit/s, None if it has none or none is set.
    """

    name: str
    kind: str
    up: bool
    bit_rate: int | None = None
    bus_off: bool = False
    #: whether the controller sends nothing, not even an acknowledge
    listen_only: bool = False

    @property
    def wired(self) -> bool:
        """Whether the link has a controller, and with it a bit rate."""
        return self.kind not in ("vcan", "vxcan")

    @property
    def about(self) -> str:
        """Short description of the link."""
        rate = "" if self.bit_rate is None else f", {kbit_s(self.bit_rate)}"
        return f"{'bus-off' if self.bus_off and self.up else 'up' if self.up else 'down'}{rate}"

    @property
    def problem(self) -> str | None:
        """Why the link carries no frames, with the command to fix it; None if it works."""
        if not self.up:
            return f"it is down: {self.way_up()}"
        if self.bus_off:
            return f"it is bus-off: sudo ip link set {self.name} type can restart"
        return None

    def way_up(self) -> str:
        """The command to set the link up, with its bit rate if set."""
        needed = f" type can bitrate {_USUAL_BIT_RATE}" if self.wired and self.bit_rate is None else ""
        return f"sudo ip link set {self.name} up{needed}"

    def way_to(self, bit_rate: int) -> str:
        """The commands to run the link at *bit_rate* (bit/s)."""
        down = f"sudo ip link set {self.name} down && " if self.up else ""
        return f"{down}sudo ip link set {self.name} up type can bitrate {bit_rate}"


def kbit_s(bit_rate: int) -> str:
    """A bit rate (bit/s) as text."""
    return f"{bit_rate / 1000:g} kbit/s"


def kernel_link(name: str) -> KernelLink | None:
    """The CAN link *name*, None if missing."""
    return next((link for link in kernel_links() if link.name == name), None)


def kernel_links() -> list[KernelLink]:
    """All CAN links of this machine, by name."""
    return sorted(links_of(_told()), key=lambda link: link.name)


def links_of(told: bytes) -> Iterator[KernelLink]:
    """The CAN links in an rtnetlink answer *told*."""
    for kind, body in _messages(told):
        if kind != _NEW_LINK or len(body) < _LINK.size:
            continue
        _, hardware, _, flags, _ = _LINK.unpack_from(body)
        if hardware == _ARPHRD_CAN:
            yield _link(dict(_attributes(body[_LINK.size :])), up=bool(flags & _IFF_UP))


def _link(said: dict[int, bytes], *, up: bool) -> KernelLink:
    info = dict(_attributes(said.get(_LINK_INFO, b"")))
    kind = info.get(_INFO_KIND, b"").rstrip(b"\0").decode("ascii", "replace")
    controller = dict(_attributes(info.get(_INFO_DATA, b""))) if kind == "can" else {}
    name = said.get(_NAME, b"").rstrip(b"\0").decode("utf-8", "replace")
    state = _number(controller.get(_STATE, b""))
    silent = bool(_number(controller.get(_MODE, b"")[_FLAGS:]) & _LISTEN_ONLY)
    return KernelLink(name, kind, up, _number(controller.get(_BIT_TIMING, b"")) or None, state == _BUS_OFF, silent)


def _number(data: bytes) -> int:
    """The 32-bit number at the start of *data*, 0 if shorter."""
    return int(struct.unpack_from("=I", data)[0]) if len(data) >= 4 else 0


def _messages(told: bytes) -> Iterator[tuple[int, bytes]]:
    """Type and body of each message; a truncated message is left out."""
    while len(told) >= _HEADER.size:
        length, kind, *_ = _HEADER.unpack_from(told)
        if not _HEADER.size <= length <= len(told):
            return
        yield kind, told[_HEADER.size : length]
        told = told[_aligned(length) :]


def _attributes(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Number and value of each attribute; a truncated attribute is left out."""
    while len(data) >= _ATTRIBUTE.size:
        length, kind = _ATTRIBUTE.unpack_from(data)
        if not _ATTRIBUTE.size <= length <= len(data):
            return
        yield kind & 0x3FFF, data[_ATTRIBUTE.size : length]
        data = data[_aligned(length) :]


def _aligned(length: int) -> int:
    return (length + 3) & ~3


def _told() -> bytes:
    """The kernel's answer about all links; partial if it falls silent, empty without rtnetlink."""
    family, told = getattr(socket, "AF_NETLINK", None), b""
    if family is None:
        return told
    try:
        with socket.socket(family, socket.SOCK_RAW, 0) as asking:
            asking.settimeout(_PATIENCE_S)
            asking.send(_HEADER.pack(_HEADER.size + _LINK.size, _GET_LINK, _ALL, 1, 0) + bytes(_LINK.size))
            ended = False
            while not ended:
                part = asking.recv(1 << 16)
                ended = not part or any(kind in (_DONE, _ERROR) for kind, _ in _messages(part))
                told += part
    except OSError:
        pass  # a kernel without it, or a sandbox: unknown
    return told

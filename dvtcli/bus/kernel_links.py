"""The CAN links of Linux from its kernel over rtnetlink: kind, up or down, bit rate, bus-off.

Read-only; needs no rights and no tool. Empty on other systems.
"""

from __future__ import annotations

import errno
import socket
import struct
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import cast

import can

from dvtcli.bus.carrier import Carrier
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.errors import BusUnavailable

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
    return KernelLink(
        name=name,
        kind=kind,
        up=up,
        bit_rate=_number(controller.get(_BIT_TIMING, b"")) or None,
        bus_off=state == _BUS_OFF,
        listen_only=silent,
    )


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


#: bytes of frames that may wait to be read (the kernel allows twice as much, and a frame takes 768 bytes): some 21,800
#: frames before an answer, and some 87,000 where each frame is wanted, 5 s of the shortest ones at 1 Mbit/s. Memory is
#: taken only while they wait
ANSWER_BUFFER, RECEIVE_BUFFER = 8 << 20, 32 << 20
#: socket options without a name in Python: a buffer beyond the system's limit, and its memory and drops
_SO_RCVBUFFORCE, _SO_MEMINFO = 33, 55
_MEMINFO = struct.Struct("=9I")
_NO_CHANNEL = "no channel was given"
#: CAN-IDs and their bits that count (CiA 301, 7.3.3) of what nodes say to a configurator: NMT, EMCY and SYNC, SDO both
#: ways, heartbeats and boot-ups. No PDOs, and nothing of 29 bits
_SERVICES = ((0x000, 0x7FF), (0x080, 0x780), (0x580, 0x780), (0x600, 0x780), (0x700, 0x780))
#: python-can's error text, without a number, if its socket is full for now
_FULL = "Transmit buffer full"


def check_link(channel: object) -> None:
    """Raise BusUnavailable with advice if *channel* is missing, unknown or down; OSError without CAN.

    A socket on a link that is down opens without error, and python-can leaves a socket open on a missing link.
    """
    if sys.platform != "linux":
        hint = Hint(Action.CHECK_SETUP, why="which interface has the adapter? {} lists the interfaces found")
        hint += "slcan adapters have a serial port"
        what = f"cannot open socketcan:{channel}" if channel else "cannot open socketcan"
        raise BusUnavailable(what, why="only Linux has SocketCAN", hint=hint)
    if not channel:
        raise BusUnavailable("cannot open socketcan", why=_NO_CHANNEL, hint="which channel?" + which(kernel_links()))
    socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    try:
        socket.if_nametoindex(str(channel))
    except OSError as failed:
        hint = "no such channel:" + which(kernel_links())
        raise _not_yet(str(channel), failed.strerror, hint) from failed
    link = kernel_link(str(channel))
    if link is not None and not link.up:
        raise _not_yet(str(channel), "it is down", link.way_up())


def _not_yet(channel: str, why: str | None, hint: Hint | str) -> BusUnavailable:
    unavailable = BusUnavailable(f"cannot open socketcan:{channel}", why=why, hint=hint)
    unavailable.may_come = True
    return unavailable


def which(links: list[KernelLink]) -> Hint:
    """The available links, in words that follow others."""
    if not links:
        give = Hint(Action.GIVE_CHANNEL, why=" give {}")
        return give + Hint(Action.CHECK_SETUP, why="this machine has no CAN link now ({})")
    first, *others = (
        Hint(Action.GIVE_CHANNEL, {"channel": link.name}, f"{', ' if number else ' '}{{}} ({verbatim(link.about)})")
        for number, link in enumerate(links)
    )
    return sum(others, first)


class KernelCarrier(Carrier):
    """The socket of python-can's *bus* on the link *channel*; *asked* is the requested bit rate (bit/s)."""

    def __init__(self, bus: can.BusABC, channel: str, asked: int | None) -> None:
        self._bus = bus
        #: filters configured by the user for python-can
        self._own_filters = bus.filters
        self._socket: socket.socket = getattr(bus, "socket")  # noqa: B009 - python-can's base class has none
        self._channel = channel
        self._told_lost = 0
        self._news: list[str] = []
        link = kernel_link(channel)
        if link is not None:
            self.bit_rate = link.bit_rate
            self._news = list(first_news(link, asked))
        self._roomy = _make_room(self._socket, ANSWER_BUFFER)

    def make_room(self) -> None:
        """Enlarge the receive buffer as far as the system allows, RECEIVE_BUFFER at most."""
        self._roomy = _make_room(self._socket, RECEIVE_BUFFER)

    def hear(self, *, everything: bool) -> None:
        """Pass on *everything*, or only services: PDOs then do not wake a thread that waits for an answer."""
        if self._own_filters is None:
            services = [{"can_id": can_id, "can_mask": mask, "extended": False} for can_id, mask in _SERVICES]
            self._bus.set_filters(None if everything else cast("can.typechecking.CanFilters", services))

    def is_full(self, error: Exception) -> bool:
        """Whether the transmit queue, or the socket's part of the queue, is full."""
        return super().is_full(error) or (isinstance(error, can.CanOperationError) and str(error) == _FULL)

    def lost_frames(self) -> int:
        """Number of frames that the kernel dropped because the socket was full."""
        try:
            return int(_MEMINFO.unpack(self._socket.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _MEMINFO.size))[8])
        except (OSError, struct.error):  # Linux before 4.12
            return 0

    def news(self) -> list[str]:
        """A bit rate other than requested, a disabled controller, lost frames."""
        news, self._news = self._news, []
        lost = self.lost_frames()
        if lost > self._told_lost:
            news.append(_lost(lost - self._told_lost, roomy=self._roomy))
            self._told_lost = lost
        return news

    def next_step(self, error: Exception) -> Hint | str:
        """Advice about *error* from the link's state."""
        if self.is_full(error):
            return (
                "its transmit queue remains full: check that another node is connected and powered, with this bit "
                "rate, to acknowledge frames"
            )
        link = kernel_link(self._channel)
        if link is None and getattr(error, "error_code", None) in (errno.ENODEV, errno.ENXIO, errno.ENETDOWN):
            return Hint(
                Action.CHECK_SETUP,
                why=f"{verbatim(self._channel)} is gone: plug the adapter in again; {{}} lists the interfaces found",
            )
        return (link and link.problem) or super().next_step(error)


def first_news(link: KernelLink, asked: int | None) -> list[str]:
    """News about *link* at the start; *asked* is the requested bit rate (bit/s)."""
    news = []
    if asked is not None and link.bit_rate is not None and asked != link.bit_rate:
        news.append(
            f"{link.name} runs at {kbit_s(link.bit_rate)}, not at {kbit_s(asked)}: only the system sets that: "
            f"{link.way_to(asked)}"
        )
    if link.up and link.problem is not None:
        news.append(f"{link.name}: {link.problem}")
    return news


def _lost(count: int, *, roomy: bool) -> str:
    more = "" if roomy else f"; more may wait after: sudo sysctl -w net.core.rmem_max={RECEIVE_BUFFER}"
    return f"this computer dropped {count} frames: they were received faster than they were read{more}"


def _make_room(link: socket.socket, size: int) -> bool:
    """Set the receive buffer to *size* bytes, or as large as allowed; whether the full size was set."""
    with suppress(OSError):  # only root may exceed the limit
        link.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, size)
        return True
    with suppress(OSError):
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, size)
    return link.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) >= size

"""What the kernel says of CAN links, taken apart; and what is said of one that is down, off, or at another bit rate.

The messages are made here, byte by byte as linux/rtnetlink.h has them; `tests/socketcan` asks a kernel.
"""

from __future__ import annotations

import struct
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.bus.kernel_links import KernelLink, check_link, first_news, kernel_link, links_of, which
from dvtcli.cli.view.typed_hints import typed
from dvtcli.errors import BusUnavailable

CAN, ETHERNET = 280, 1
DONE = struct.pack("=IHHII", 20, 3, 2, 1, 0) + bytes(4)


def attribute(kind: int, value: bytes) -> bytes:
    return struct.pack("=HH", 4 + len(value), kind) + value + bytes(-len(value) % 4)


def told(name: str, kind: str = "", *, hardware: int = CAN, flags: int = 0, controller: bytes = b"") -> bytes:
    """One link as the kernel tells it."""
    info = attribute(1, kind.encode() + b"\0") + attribute(0x8000 | 2, controller)
    attributes = attribute(3, name.encode() + b"\0") + attribute(16, bytes(1)) + attribute(0x8000 | 18, info)
    body = struct.pack("=BxHiII", 0, hardware, 3, flags, 0) + attributes
    return struct.pack("=IHHII", 16 + len(body), 16, 2, 1, 0) + body


def timing(bit_rate: int) -> bytes:
    return attribute(1, struct.pack("=8I", bit_rate, *range(7)))


def state(number: int) -> bytes:
    return attribute(4, struct.pack("=I", number))


def test_links_are_told_with_kind_state_and_bit_rate() -> None:
    said = [
        told("eth0", hardware=ETHERNET, flags=1),
        told("can0", "can", flags=0x40081, controller=timing(500_000) + state(0)),
        told("can1", "can", flags=0x40080, controller=timing(250_000) + state(4)),
        told("can2", "can", controller=state(4)),
        told("can3", "can", flags=1, controller=timing(125_000) + state(3)),
        told("vcan0", "vcan", flags=1),
        told("to-box", "vxcan", controller=attribute(1, bytes(32))),
        DONE,
    ]
    assert list(links_of(b"".join(said))) == [
        KernelLink("can0", "can", up=True, bit_rate=500_000),
        KernelLink("can1", "can", up=False, bit_rate=250_000),
        KernelLink("can2", "can", up=False),
        KernelLink("can3", "can", up=True, bit_rate=125_000, bus_off=True),
        KernelLink("vcan0", "vcan", up=True),
        KernelLink("to-box", "vxcan", up=False),
    ]


def test_what_is_cut_off_is_left_out() -> None:
    whole = told("can0", "can", flags=1, controller=timing(500_000))
    assert list(links_of(whole + whole[:-8])) == list(links_of(whole))


@given(st.binary(max_size=80), st.integers(0, 200), st.binary(max_size=8))
def test_whatever_is_told_is_taken_apart(rubbish: bytes, place: int, spoilt: bytes) -> None:
    whole = told("can0", "can", flags=1, controller=timing(500_000))
    list(links_of(rubbish))
    list(links_of(whole[:place] + spoilt + whole[place + len(spoilt) :]))


def test_a_link_that_is_not_there_is_none() -> None:
    assert kernel_link("no-such-link") is None


@pytest.mark.parametrize(
    ("link", "about", "problem"),
    [
        (KernelLink("can0", "can", True, 500_000), "up, 500 kbit/s", None),
        (KernelLink("can1", "can", False), "down", "it is down: sudo ip link set can1 up type can bitrate 500000"),
        (KernelLink("can1", "can", False, 250_000), "down, 250 kbit/s", "it is down: sudo ip link set can1 up"),
        (KernelLink("box", "", False), "down", "it is down: sudo ip link set box up type can bitrate 500000"),
        (KernelLink("vcan0", "vcan", False), "down", "it is down: sudo ip link set vcan0 up"),
        (KernelLink("vxcan1", "vxcan", False), "down", "it is down: sudo ip link set vxcan1 up"),
        (
            KernelLink("can0", "can", True, 125_000, bus_off=True),
            "bus-off, 125 kbit/s",
            "it is bus-off: sudo ip link set can0 type can restart",
        ),
    ],
)
def test_each_state_has_its_next_step(link: KernelLink, about: str, problem: str | None) -> None:
    assert (link.about, link.problem) == (about, problem)


def test_another_bit_rate_than_the_one_asked_for_is_told() -> None:
    link = KernelLink("can0", "can", True, 500_000)
    (told_once,) = first_news(link, 250_000)
    assert told_once.startswith("can0 runs at 500 kbit/s, not at 250 kbit/s")
    assert told_once.endswith("sudo ip link set can0 down && sudo ip link set can0 up type can bitrate 250000")
    assert first_news(link, 500_000) == first_news(link, None) == []
    assert first_news(KernelLink("vcan0", "vcan", True), 250_000) == []


def test_bus_off_is_told_at_once() -> None:
    (told_once,) = first_news(KernelLink("can0", "can", True, 500_000, bus_off=True), None)
    assert "bus-off" in told_once


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has SocketCAN")
@pytest.mark.parametrize("channel", [None, ""])
def test_without_a_channel_those_of_this_machine_are_named(channel: str | None) -> None:
    with pytest.raises(BusUnavailable) as caught:
        check_link(channel)
    assert "which channel?" in typed(caught.value.hint)
    assert "-c" in typed(caught.value.hint)
    two = [KernelLink("can0", "can", True, 500_000), KernelLink("vcan0", "vcan", False)]
    assert typed(which(two)) == " -c can0 (up, 500 kbit/s), -c vcan0 (down)"

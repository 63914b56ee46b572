"""A device with SRDOs (EN 50325-5): its configuration is guarded, and each SRDO is two frames, the second inverted."""

from __future__ import annotations

import pytest

from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.simulator.bench import Aborted, Client, booted

VALID, SIGNATURE = 0xA5, 0x13FF
RECEIVED = (0x105, 0x106)
STATE, RANGE, ACCESS, LENGTH = 0x0800_0022, 0x0609_0030, 0x0601_0000, 0x0604_0042


def refused(client: Client, index: int, sub_index: int, value: int, size: int) -> int:
    with pytest.raises(Aborted) as caught:
        client.write(index, sub_index, value, size)
    return caught.value.code


def pairs(device: StrictDevice, *times_s: float) -> list[tuple[float, str, str]]:
    """The SRDO frames sent at each of *times_s*, as hex."""
    found = []
    for now_s in times_s:
        frames = [frame for frame in device.services.poll(now_s) if 0x101 <= frame.can_id <= 0x180]
        if frames:
            assert [frame.can_id for frame in frames] == [0x101, 0x102]
            found.append((now_s, frames[0].data.hex(), frames[1].data.hex()))
    return found


def test_it_sends_its_data_and_the_inverted_data_each_refresh_time_in_operational_only() -> None:
    device = booted("safety")
    assert pairs(device, 0.0, 0.03) == []
    device.nmt(NmtCommand.START)
    device.set_value(0x2100, 1, b"\x05")
    assert pairs(device, 0.1, 0.11, 0.125, 0.13) == [(0.1, "05", "fa"), (0.125, "05", "fa")]
    assert device.value(0x2101, 1) == b"\xfa"
    assert device.services.next_poll_s() == pytest.approx(0.15)
    device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    assert pairs(device, 0.2) == []


@pytest.mark.parametrize(
    ("index", "sub_index", "value", "size"),
    [(0x1301, 2, 30, 2), (0x1382, 1, 0x21000108, 4), (0x13FE, 0, VALID, 1), (SIGNATURE, 1, 1, 2)],
)
def test_nothing_is_configured_in_operational(index: int, sub_index: int, value: int, size: int) -> None:
    device = booted("safety")
    device.nmt(NmtCommand.START)
    assert refused(Client.on(device), index, sub_index, value, size) == STATE


@pytest.mark.parametrize(
    ("index", "sub_index", "value", "size", "code"),
    [
        (0x1301, 1, 3, 1, RANGE), (0x1301, 2, 0, 2, RANGE), (0x1301, 3, 0, 1, RANGE), (0x1301, 4, 255, 1, RANGE),
        (0x1301, 5, 0x181, 4, RANGE), (0x1301, 5, 0x102, 4, RANGE), (0x1301, 6, 0x105, 4, RANGE),
        (0x1381, 0, 0, 1, ACCESS), (0x1381, 1, 0x21000108, 4, ACCESS), (0x1382, 0, 1, 1, LENGTH),
    ],
)  # fmt: skip
def test_values_of_no_srdo_are_refused(index: int, sub_index: int, value: int, size: int, code: int) -> None:
    assert refused(Client.on(booted("safety")), index, sub_index, value, size) == code


def test_entries_are_written_while_the_srdo_is_off_and_its_count_is_0() -> None:
    client = Client.on(booted("safety"))
    client.write(0x1382, 1, 0x21000108, 4)
    client.write(0x1382, 2, 0x21010108, 4)
    client.write(0x1382, 0, 2, 1)
    assert refused(client, 0x1382, 1, 0x21010108, 4) == ACCESS


@pytest.mark.parametrize(
    ("index", "sub_index", "value", "size"), [(0x1301, 2, 30, 2), (0x1382, 1, 0, 4), (0x13FF, 1, 1, 2)]
)
def test_a_change_invalidates_the_configuration_and_no_srdo_is_sent(
    index: int, sub_index: int, value: int, size: int
) -> None:
    device = booted("safety")
    client = Client.on(device)
    client.write(index, sub_index, value, size)
    assert client.number(0x13FE) == 0
    device.nmt(NmtCommand.START)
    assert (device.state, pairs(device, 0.0, 0.1)) == (NmtState.OPERATIONAL, [])


def test_a_wrong_signature_is_an_error_at_the_start() -> None:
    device = booted("safety")
    client = Client.on(device)
    client.write(0x1301, 2, 50, 2)
    client.write(0x13FE, 0, VALID, 1)
    device.nmt(NmtCommand.START)
    sent = device.services.poll(0.0)
    assert Frame(0x81, b"\x00\x63\x01" + bytes(5)) in sent
    assert client.number(0x13FE) == 0
    assert pairs(device, 0.1) == []


def receiving() -> StrictDevice:
    """SRDO2 is received: 6200:01, and 2101:01 as its inverted object; the signature is right."""
    device = booted("safety")
    client = Client.on(device)
    client.write(0x1382, 1, 0x62000108, 4)
    client.write(0x1382, 2, 0x21010108, 4)
    client.write(0x1382, 0, 2, 1)
    for sub_index, value, size in ((1, 2, 1), (5, RECEIVED[0], 4), (6, RECEIVED[1], 4)):
        client.write(0x1302, sub_index, value, size)
    client.write(SIGNATURE, 2, 0xB60F, 2)
    client.write(0x13FE, 0, VALID, 1)
    device.nmt(NmtCommand.START)
    device.services.poll(0.0)
    assert client.number(0x13FE) == VALID
    return device


def test_it_takes_a_pair_whose_second_frame_is_the_inverted_first() -> None:
    device = receiving()
    assert device.services.hears(Frame(RECEIVED[0], b"\x0f"))
    device.services.receive(Frame(RECEIVED[0], b"\x0f"))
    assert device.value(0x6200, 1) == b"\x00"
    device.services.receive(Frame(RECEIVED[1], b"\xf0"))
    assert (device.value(0x6200, 1), device.value(0x2101, 1)) == (b"\x0f", b"\xf0")


@pytest.mark.parametrize("frames", [((0, b"\x0f"), (1, b"\xf1")), ((1, b"\xf0"),), ((1, b"\xf0"), (0, b"\x0f"))])
def test_it_takes_no_other_pair(frames: tuple[tuple[int, bytes], ...]) -> None:
    device = receiving()
    for which, data in frames:
        device.services.receive(Frame(RECEIVED[which], data))
    assert device.value(0x6200, 1) == b"\x00"


def test_a_device_of_any_file_without_safety_configuration_has_no_srdos() -> None:
    device = booted("generic")
    device.nmt(NmtCommand.START)
    assert not device.services.hears(Frame(0x101, b"\0"))

"""Multiplexed PDOs at work (CiA 301, 7.2.2.6): by source with scanner and dispatcher lists, and by destination."""

from __future__ import annotations

import pytest

from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.simulator.bench import Client, booted

#: TPDO1 and RPDO1 are SAM, TPDO2 (off) and RPDO2 are DAM
SAM_SENT, DAM_SENT, SAM_TAKEN, DAM_TAKEN = 0x181, 0x281, 0x201, 0x301
PRODUCER, OWN = 9, 1


def mpdo(node: int, index: int, sub_index: int, value: int) -> bytes:
    return bytes([node]) + index.to_bytes(2, "little") + bytes([sub_index]) + value.to_bytes(4, "little")


def started(*, inhibit: int = 0, event: int = 0, dam: bool = False) -> StrictDevice:
    """The family in OPERATIONAL without heartbeats; *inhibit* in 100 µs and *event* in ms of its TPDO."""
    device = booted("mpdo")
    client = Client.on(device)
    client.write(0x1017, 0, 0, 2)
    pdo, cob_id = (0x1801, DAM_SENT) if dam else (0x1800, SAM_SENT)
    client.write(0x1800, 1, 0x80000181, 4)
    client.write(pdo, 3, inhibit, 2)
    client.write(pdo, 5, event, 2)
    client.write(pdo, 1, cob_id, 4)
    device.nmt(NmtCommand.START)
    return device


def change(device: StrictDevice, index: int, sub_index: int, value: int) -> None:
    device.set_value(index, sub_index, value.to_bytes(len(device.value(index, sub_index)), "little"))


ALL_AT_START = [(0x2000, 1), (0x2001, 1), (0x2001, 2), (0x2001, 3)]


def test_each_object_of_the_scanner_list_is_sent_at_the_start_and_on_change() -> None:
    device = started()
    first = device.services.poll(0.0)
    assert [(int.from_bytes(frame.data[1:3], "little"), frame.data[3]) for frame in first] == ALL_AT_START
    assert {(frame.can_id, frame.data[0], len(frame.data)) for frame in first} == {(SAM_SENT, OWN, 8)}
    assert device.services.poll(1.0) == []
    change(device, 0x2001, 2, 0x1234)
    assert device.services.poll(1.1) == [Frame(SAM_SENT, mpdo(OWN, 0x2001, 2, 0x1234))]


def test_the_inhibit_time_parts_the_frames_and_the_latest_value_is_sent() -> None:
    device = started(inhibit=1250)  # 125 ms
    sent = [(step, len(device.services.poll(step / 16))) for step in range(10)]
    assert [step for step, count in sent if count] == [0, 2, 4, 6]
    assert {count for _, count in sent} == {0, 1}
    change(device, 0x2000, 1, 5)
    assert len(device.services.poll(10 / 16)) == 1
    change(device, 0x2000, 1, 6)
    assert device.services.poll(11 / 16) == []
    assert device.services.next_poll_s() == pytest.approx(12 / 16)
    change(device, 0x2000, 1, 7)
    assert device.services.poll(12 / 16) == [Frame(SAM_SENT, mpdo(OWN, 0x2000, 1, 7))]


def test_the_event_timer_sends_all_again() -> None:
    device = started(event=50)
    assert [len(device.services.poll(step / 20)) for step in range(3)] == [4, 4, 4]


def test_neither_sync_nor_a_remote_frame_asks_for_one() -> None:
    device = started()
    device.services.poll(0.0)
    assert device.services.sync() == []
    assert device.services.receive(Frame(SAM_SENT, b"", remote=True)) == []


def test_by_destination_the_mapped_object_goes_to_all_nodes() -> None:
    device = started(dam=True)
    place = Client.on(device).number(0x1A01, 1)
    index, sub_index = place >> 16, place >> 8 & 0xFF
    assert [frame.data[0] for frame in device.services.poll(0.0)] == [0x80]
    change(device, index, sub_index, 0x55)
    assert device.services.poll(0.1) == [Frame(DAM_SENT, mpdo(0x80, index, sub_index, 0x55))]


@pytest.mark.parametrize(
    ("frame", "taken"),
    [
        (mpdo(PRODUCER, 0x2000, 1, 0x1234), {(0x2100, 1): 0x1234}),
        (mpdo(PRODUCER, 0x2001, 1, 21), {(0x2100, 2): 21}),
        (mpdo(PRODUCER, 0x2001, 2, 22), {(0x2100, 3): 22}),
        (mpdo(PRODUCER, 0x2001, 3, 23), {}),
        (mpdo(PRODUCER + 1, 0x2000, 1, 0x1234), {}),
        (mpdo(0x80 | PRODUCER, 0x2000, 1, 0x1234), {}),
    ],
)
def test_by_source_the_dispatcher_list_says_what_is_taken(frame: bytes, taken: dict[tuple[int, int], int]) -> None:
    device = started()
    before = {(0x2100, sub): Client.on(device).number(0x2100, sub) for sub in (1, 2, 3)}
    assert device.services.receive(Frame(SAM_TAKEN, frame)) == []
    after = {place: Client.on(device).number(*place) for place in before}
    assert after == before | taken


@pytest.mark.parametrize(("node", "taken"), [(0x80 | OWN, True), (0x80, True), (0x80 | 2, False), (OWN, False)])
def test_by_destination_the_node_in_the_frame_takes_it(node: int, *, taken: bool) -> None:
    device = started()
    assert device.services.receive(Frame(DAM_TAKEN, mpdo(node, 0x2100, 1, 77))) == []
    assert (Client.on(device).number(0x2100, 1) == 77) is taken


@pytest.mark.parametrize("place", [(0x2FFF, 0), (0x2100, 0x20), (0x2000, 1)])
def test_an_mpdo_for_no_object_that_can_be_written_is_an_error_that_the_next_ends(place: tuple[int, int]) -> None:
    device = started()
    error = device.services.receive(Frame(DAM_TAKEN, mpdo(0x80 | OWN, *place, 1)))
    assert [frame.data[:3] for frame in error] == [b"\x30\x82\x11"]
    over = device.services.receive(Frame(DAM_TAKEN, mpdo(0x80 | OWN, 0x2100, 1, 1)))
    assert [frame.data[:2] for frame in over] == [b"\0\0"]


def test_a_short_one_is_an_error() -> None:
    device = started()
    error = device.services.receive(Frame(SAM_TAKEN, bytes(7)))
    assert [frame.data[:2] for frame in error] == [b"\x10\x82"]

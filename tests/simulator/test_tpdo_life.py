"""When TPDOs are sent: on change, by event timer, within the inhibit time, on remote frames; and what RPDOs miss."""

from __future__ import annotations

import pytest

from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.station import SimulatedNode
from tests.simulator.bench import Client, booted
from tests.virtual_time import VirtualTimeBus

STATUS, STATUS_FRAME = 0x6041, 0x181
Write = tuple[int, int, int, int]


def alone(*writes: Write, cob_id: int = 0x181, inhibit: int = 0, event: int = 0, kind: int = 255) -> StrictDevice:
    """A generic device in OPERATIONAL at 0 s with one TPDO, of the statusword; *inhibit* in 100 µs, *event* in ms."""
    device = booted()
    client = Client.on(device)
    for index in (0x1800, 0x1801, 0x1802, 0x1803):
        client.write(index, 1, 0xC0000000, 4)
    client.write(0x1017, 0, 0, 2)
    client.write(0x1800, 1, 1 << 31 | cob_id, 4)
    for sub_index, value, size in ((3, inhibit, 2), (5, event, 2), (2, kind, 1), (1, cob_id, 4)):
        client.write(0x1800, sub_index, value, size)
    for write in writes:
        client.write(*write)
    device.nmt(NmtCommand.START)
    return device


def change(device: StrictDevice, value: int) -> None:
    device.set_value(STATUS, 0, value.to_bytes(2, "little"))


def sent(device: StrictDevice, *times_s: float) -> list[float]:
    """The times at which something was sent."""
    return [now_s for now_s in times_s if device.services.poll(now_s)]


def test_on_change_and_once_at_the_start() -> None:
    device = alone()
    assert device.services.poll(0.0) == [Frame(STATUS_FRAME, b"\x50\x02")]
    assert device.services.poll(1.0) == []
    assert device.services.next_poll_s() is None
    change(device, 0x1234)
    assert device.services.next_poll_s() == 0.0
    assert device.services.poll(1.1) == [Frame(STATUS_FRAME, b"\x34\x12")]
    change(device, 0x1234)
    assert device.services.poll(1.2) == []


def test_a_change_that_is_undone_before_it_was_seen_is_none() -> None:
    device = alone()
    device.services.poll(0.0)
    change(device, 0)
    change(device, 0x0250)
    assert device.services.poll(0.1) == []


def test_the_inhibit_time_holds_back_what_changed_and_then_sends_the_latest() -> None:
    device = alone(inhibit=1000)  # 100 ms
    device.services.poll(0.0)
    change(device, 1)
    assert device.services.poll(0.05) == []
    assert device.services.next_poll_s() == pytest.approx(0.1)
    change(device, 2)
    assert device.services.poll(0.06) == []
    assert device.services.poll(0.1) == [Frame(STATUS_FRAME, b"\x02\x00")]
    assert device.services.poll(0.3) == []
    change(device, 3)
    assert device.services.poll(0.31) == [Frame(STATUS_FRAME, b"\x03\x00")]


def test_the_event_timer_sends_what_did_not_change() -> None:
    device = alone(event=50)
    assert sent(device, *(step / 128 for step in range(33))) == [0, 7 / 128, 13 / 128, 20 / 128, 26 / 128, 32 / 128]
    assert device.services.next_poll_s() == pytest.approx(0.3)


def test_a_change_starts_the_event_timer_again() -> None:
    device = alone(event=50)
    device.services.poll(0.0)
    change(device, 1)
    assert sent(device, 0.03, 0.05, 0.07, 0.08) == [0.03, 0.08]


def test_late_event_timers_are_not_made_up_for() -> None:
    device = alone(event=50)
    assert sent(device, 0.0, 1.02, 1.03, 1.06, 1.07) == [0.0, 1.02, 1.07]


def test_an_inhibit_time_longer_than_the_event_timer_wins() -> None:
    device = alone(event=50, inhibit=1000)
    device.services.poll(0.0)
    assert device.services.next_poll_s() == pytest.approx(0.1)
    assert sent(device, 0.05, 0.1, 0.15, 0.2) == [0.1, 0.2]


def test_only_in_operational_and_anew_after_each_start() -> None:
    device = alone(event=50)
    device.services.poll(0.0)
    device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    assert device.services.poll(0.05) == []
    assert device.services.next_poll_s() is None
    device.nmt(NmtCommand.START)
    assert device.services.poll(0.06) == [Frame(STATUS_FRAME, b"\x50\x02")]
    assert device.services.next_poll_s() == pytest.approx(0.11)


def test_enabling_again_starts_anew_with_the_new_settings() -> None:
    device = alone(event=50)
    device.services.poll(0.0)
    client = Client.on(device)
    client.write(0x1800, 1, 0x80000181, 4)
    assert sent(device, 0.05, 0.1) == []
    client.write(0x1800, 5, 20, 2)
    client.write(0x1800, 1, 0x181, 4)
    assert sent(device, 0.2, 0.21, 0.22, 0.24) == [0.2, 0.22, 0.24]


def test_the_event_timer_may_change_while_the_pdo_is_valid() -> None:
    device = alone()
    device.services.poll(0.0)
    Client.on(device).write(0x1800, 5, 10, 2)
    assert sent(device, 0.1, 0.11, 0.12) == [0.1, 0.11, 0.12]


@pytest.mark.parametrize("kind", [1, 0, 253])
def test_other_types_have_no_event_timer_and_are_not_sent_on_change(kind: int) -> None:
    device = alone(event=50, kind=kind)
    change(device, 1)
    assert sent(device, 0.0, 0.05, 0.1) == []


def test_an_rpdo_moves_a_tpdo_of_the_same_object() -> None:
    """TPDO and RPDO share the one dictionary: 2000 is mapped in both."""
    mapping: tuple[Write, ...] = (
        (0x1800, 1, 0x80000181, 4), (0x1A00, 0, 0, 1), (0x1A00, 1, 0x20000020, 4), (0x1A00, 0, 1, 1),
        (0x1800, 1, 0x181, 4), (0x1602, 0, 0, 1), (0x1602, 1, 0x20000020, 4), (0x1602, 0, 1, 1),
        (0x1402, 1, 0x401, 4),
    )  # fmt: skip
    device = alone(*mapping)
    device.services.poll(0.0)
    assert device.services.receive(Frame(0x401, b"\x01\x02\x03\x04")) == []
    assert device.services.poll(0.1) == [Frame(STATUS_FRAME, b"\x01\x02\x03\x04")]


REQUEST = Frame(STATUS_FRAME, b"", remote=True)


@pytest.mark.parametrize("kind", [1, 253, 254, 255])
def test_a_remote_frame_brings_any_tpdo_that_allows_it(kind: int) -> None:
    device = alone(kind=kind)
    device.services.poll(0.0)
    assert device.services.receive(REQUEST) == [Frame(STATUS_FRAME, b"\x50\x02")]
    assert device.services.receive(Frame(STATUS_FRAME, b"", extended=True, remote=True)) == []


def test_remote_frames_are_refused_by_bit_30_and_outside_operational() -> None:
    device = alone(cob_id=0x40000181)
    assert device.services.receive(REQUEST) == []
    device = alone()
    device.nmt(NmtCommand.STOP)
    assert device.services.receive(REQUEST) == []


def test_type_252_samples_at_sync_and_answers_with_the_sample() -> None:
    device = alone(kind=252)
    assert device.services.receive(REQUEST) == []
    assert device.services.sync() == []
    change(device, 1)
    assert device.services.receive(REQUEST) == [Frame(STATUS_FRAME, b"\x50\x02")]
    device.services.sync()
    assert device.services.receive(REQUEST) == [Frame(STATUS_FRAME, b"\x01\x00")]


def test_node_guarding_is_not_answered() -> None:
    node = SimulatedNode(alone())
    assert node.handle(Frame(0x701, b"", remote=True)) == []


DEADLINE: tuple[Write, ...] = ((0x1400, 5, 100, 2),)


def test_the_event_timer_of_an_rpdo_is_a_deadline() -> None:
    device = alone(*DEADLINE, kind=1)
    assert sent(device, 0.0, 1.0) == []
    for now_s in (1.0, 1.09):
        device.services.receive(Frame(0x201, b"\x1f\x00"))
        assert device.services.poll(now_s) == []
    assert device.services.next_poll_s() == pytest.approx(1.19)
    assert device.services.poll(1.2) == [Frame(0x81, bytes.fromhex("5082110000000000"))]
    assert device.services.poll(9.0) == []
    assert device.services.receive(Frame(0x201, b"\x1f\x00")) == [Frame(0x81, bytes(8))]


def test_in_virtual_time_the_event_timer_runs_by_itself() -> None:
    device = alone(event=50)
    with_time = VirtualTimeBus([device])
    received = [frame for frame in with_time.receive(0.5205) if frame.can_id == STATUS_FRAME]
    assert len(received) == 10
    assert received[-1].timestamp_s - received[0].timestamp_s == pytest.approx(0.45)
    assert device.state is NmtState.OPERATIONAL

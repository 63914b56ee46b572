"""The bus in virtual time: waiting costs no real time, and the same calls see the same."""

from __future__ import annotations

import time

import pytest

from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.errors import BusUnavailable, NoAnswer, SdoAborted, UsageError
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.bus.devices import device
from tests.virtual_time import VirtualTimeBus

REQUEST = (0x1800, 2, b"\x05")


def faulty(*faults: str, timeout_s: float = 0.5, retries: int = 1) -> VirtualTimeBus:
    return VirtualTimeBus(
        [device(1)], faults=[Fault.parse(text) for text in faults], timeout_s=timeout_s, retries=retries
    )


def with_heartbeat(period_ms: int) -> StrictDevice:
    made = device(1)
    made.set_value(0x1017, 0, period_ms.to_bytes(2, "little"))
    return made


def test_a_time_out_takes_exactly_the_time_out() -> None:
    bus = faulty("lose-response@1", timeout_s=0.7)
    started_s = bus.now_s()
    with pytest.raises(NoAnswer):
        bus.sdo(1).download(*REQUEST)
    assert bus.now_s() - started_s == pytest.approx(0.7, abs=1e-9)


def test_a_read_waits_once_more() -> None:
    bus = VirtualTimeBus([device(1)], timeout_s=0.5, retries=1)
    started_s = bus.now_s()
    with pytest.raises(NoAnswer):
        bus.sdo(2).upload(0x1000, 0)
    assert bus.now_s() - started_s == pytest.approx(1.0, abs=1e-9)


def test_time_outs_take_no_time_of_the_clock_on_the_wall(monkeypatch: pytest.MonkeyPatch) -> None:
    for waits in ("sleep", "monotonic", "time", "perf_counter"):
        monkeypatch.delattr(time, waits)
    bus = VirtualTimeBus([device(1)], timeout_s=10, retries=0)
    for _ in range(100):
        with pytest.raises(NoAnswer):
            bus.sdo(7).upload(0x1000, 0)
    assert bus.now_s() > 1000


def test_the_same_calls_see_the_same() -> None:
    seen: list[list[tuple[Frame, bool]]] = []
    for _ in range(2):
        bus = VirtualTimeBus([with_heartbeat(70)], faults=[Fault.parse("late@2=0.8")])
        frames: list[tuple[Frame, bool]] = []
        bus.tap(lambda frame, sent, frames=frames: frames.append((frame, sent)))
        bus.sdo(1).download(*REQUEST)
        with pytest.raises(NoAnswer):
            bus.sdo(1).download(*REQUEST)
        bus.sdo(1).upload(0x1800, 2)
        seen.append(frames)
    assert seen[0] == seen[1]
    assert len(seen[0]) > 10


def test_heartbeats_come_as_time_passes() -> None:
    bus = VirtualTimeBus([with_heartbeat(100)])
    beats = [frame for frame in bus.receive(1.0) if frame.can_id == 0x701]
    assert 9 <= len(beats) <= 11
    bus.send_nmt(NmtCommand.START, 1)
    assert bus.nmt_state(1) is None
    assert bus.nmt_state(1, 0.5) is NmtState.OPERATIONAL


def test_receive_keeps_frames_that_come_while_other_things_are_done() -> None:
    bus = VirtualTimeBus([with_heartbeat(100)])
    frames = bus.receive(0.3)
    bus.sleep(0.25)
    bus.sdo(1).upload(0x1000, 0)
    assert sum(frame.can_id == 0x701 for frame in frames) >= 2


def test_nodes_hear_each_other() -> None:
    producer, consumer = device(1), device(2)
    bus = VirtualTimeBus([producer, consumer])
    sdo, other = bus.sdo(1), bus.sdo(2)
    for channel, can_id, base, word in (
        (sdo, 0x40000181, 0x1800, 0x60410010),
        (other, 0x00000181, 0x1400, 0x60400010),
    ):
        channel.download(base, 1, (can_id | 1 << 31).to_bytes(4, "little"))
        channel.download(base + 0x200, 0, b"\0")
        channel.download(base + 0x200, 1, word.to_bytes(4, "little"))
        channel.download(base + 0x200, 0, b"\1")
        channel.download(base, 2, b"\1" if base == 0x1800 else b"\xff")
        channel.download(base, 1, can_id.to_bytes(4, "little"))
    producer.set_value(0x6041, 0, b"\x37\x12")
    bus.send_nmt(NmtCommand.START, 0)
    bus.send(Frame(0x080, b""))
    assert consumer.value(0x6040) == b"\x37\x12"


def test_a_reset_takes_its_time_and_is_seen() -> None:
    bus = faulty("reset@1=0.4", timeout_s=0.1)
    seen = bus.boot_ups(1)
    with pytest.raises(NoAnswer):
        bus.sdo(1).download(*REQUEST)
    assert bus.boot_ups(1) == seen
    assert bus.wait_boot_up(1, seen, 1)
    assert bus.now_s() == pytest.approx(0.4, abs=0.002)
    assert bus.sdo(1).upload(0x1800, 2) != b"\x05"


def test_a_dead_bus_is_dead_at_once_and_for_good() -> None:
    bus = faulty("bus-error@1")
    started_s = bus.now_s()
    with pytest.raises(BusUnavailable) as caught:
        bus.sdo(1).download(*REQUEST)
    assert caught.value.state == "unknown"
    assert bus.now_s() == started_s
    for use in (
        lambda: bus.sdo(1).upload(0x1000, 0),
        lambda: bus.send_nmt(NmtCommand.START, 1),
        lambda: bus.nmt_state(1, 1),
        lambda: bus.boot_ups(1),
        lambda: bus.wait_boot_up(1, 0, 1),
        lambda: bus.receive(1),
        lambda: bus.sleep(1),
    ):
        with pytest.raises(BusUnavailable):
            use()


def test_a_closed_bus_says_so() -> None:
    bus = faulty()
    bus.close()
    bus.close()
    with pytest.raises(BusUnavailable, match="closed"):
        bus.sdo(1).upload(0x1000, 0)


def test_events_and_node_ids() -> None:
    bus = faulty()
    events: list[object] = []
    end = bus.on_event(events.append)
    bus.send_nmt(NmtCommand.RESET_NODE, 1)
    bus.sleep(0.01)
    end()
    assert events
    with pytest.raises(UsageError):
        bus.sdo(128)
    with pytest.raises(UsageError):
        bus.send_nmt(NmtCommand.START, 128)


def test_an_abort_is_an_abort() -> None:
    with pytest.raises(SdoAborted) as caught:
        faulty("refuse@1=0x06040041").sdo(1).download(*REQUEST)
    assert caught.value.code == 0x06040041

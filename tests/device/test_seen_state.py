"""In which state a node is seen after a command, how long that is waited for, and what may be asked. Virtual time."""

from __future__ import annotations

import pytest

from dvtcli.device.nmt_gate import NodeAccess
from dvtcli.device.seen_state import CONTROLWORDS, seen_state, seen_states, why_it_may_move
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.ports import Frame
from dvtcli.errors import NoAnswer
from dvtcli.files.eds.reader import parse_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.cli.commands.nodes.test_nmt import guarded
from tests.laws.bench import NODE, booted, dictionary, profile
from tests.virtual_time import VirtualTimeBus

OPERATIONAL, PRE_OPERATIONAL, STOPPED = NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL, NmtState.STOPPED


class Asked(VirtualTimeBus):
    """A bus that keeps the remote frames that were sent over it; *remote_frames* says whether it carries any."""

    remote_frames = True

    def __init__(self, *devices: StrictDevice) -> None:
        super().__init__(devices)
        self.requests: list[Frame] = []

    def send(self, frame: Frame) -> None:
        if frame.remote:
            self.requests.append(frame)
        super().send(frame)

    @property
    def carries_remote_frames(self) -> bool:
        return self.remote_frames


def with_heartbeat(period_ms: int, *, obeys: bool = True, node_id: int = NODE) -> StrictDevice:
    device = StrictDevice(dictionary("generic"), load_family("generic"), node_id)
    device.set_value(0x1017, 0, period_ms.to_bytes(2, "little"))
    device.ignores_nmt = not obeys
    return device


def seen(bus: Asked, wanted: NmtState = OPERATIONAL, node_id: int = NODE) -> tuple[NmtState | None, float]:
    """The state that is seen after the command to it, and how long that took."""
    bus.send_nmt(NmtCommand.STOP if wanted is STOPPED else NmtCommand.START, node_id)
    started_s = bus.now_s()
    return seen_state(NodeAccess(bus, node_id, profile("generic")), wanted), bus.now_s() - started_s


@pytest.mark.parametrize("period_ms", [100, 1000, 4000, 60_000])
def test_the_next_heartbeat_is_waited_for_and_no_longer(period_ms: int) -> None:
    bus = Asked(with_heartbeat(period_ms))
    state, took_s = seen(bus)
    assert state is OPERATIONAL
    assert took_s <= period_ms / 1000 + 0.1
    assert bus.requests == []


@pytest.mark.parametrize(("period_ms", "waited_s"), [(100, 1.5), (500, 1.5), (900, 2.3), (2000, 4.5), (20_000, 40.5)])
def test_a_node_that_stays_has_two_heartbeats_and_half_a_second(period_ms: int, waited_s: float) -> None:
    bus = Asked(with_heartbeat(period_ms, obeys=False))
    bus.sleep(period_ms / 1000 * 1.2)
    state, took_s = seen(bus)
    assert state is PRE_OPERATIONAL
    assert took_s == pytest.approx(waited_s, abs=0.015)
    assert bus.requests == []


def silent(guard_ms: int = 0, factor: int = 0) -> StrictDevice:
    """A node without heartbeats that can be asked for its state; its life is guarded where both are given."""
    device = guarded()
    device.set_value(0x100C, 0, guard_ms.to_bytes(2, "little"))
    device.set_value(0x100D, 0, bytes([factor]))
    return device


@pytest.mark.parametrize(("guard_ms", "factor"), [(0, 0), (100, 0), (1000, 0), (0, 3)])
def test_without_heartbeats_it_is_asked_once_where_that_starts_nothing(guard_ms: int, factor: int) -> None:
    bus = Asked(silent(guard_ms, factor))
    state, took_s = seen(bus)
    assert state is OPERATIONAL
    assert took_s == pytest.approx(1.5, abs=0.03)
    assert bus.requests == [Frame(0x700 + NODE, b"", remote=True)]


def test_a_node_whose_life_is_guarded_is_not_asked() -> None:
    bus = Asked(silent(100, 3))
    assert seen(bus)[0] is None
    assert bus.requests == []


def test_a_bus_without_remote_frames_asks_nobody() -> None:
    bus = Asked(silent())
    bus.remote_frames = False
    assert seen(bus)[0] is None
    assert bus.requests == []


def test_a_node_that_was_heard_is_not_asked() -> None:
    device = silent()
    bus = Asked(device)
    bus.send_nmt(NmtCommand.START, NODE)
    device.restart()
    device.boot_up()
    device.set_value(0x1017, 0, b"\0\0")
    assert seen_state(NodeAccess(bus, NODE, profile("generic")), OPERATIONAL) is PRE_OPERATIONAL
    assert bus.requests == []


def test_what_a_node_does_not_answer_is_waited_for_a_fifth_of_a_second() -> None:
    bus = Asked(with_heartbeat(0))
    state, took_s = seen(bus)
    assert state is None
    assert took_s == pytest.approx(1.7, abs=0.03)
    assert len(bus.requests) == 1


@pytest.mark.parametrize("obeys", [True, False])
def test_a_node_that_is_to_stop_is_asked_nothing(obeys: bool) -> None:
    """A stopped node answers no SDO, so that nobody knows how it could be seen."""
    device = silent()
    device.ignores_nmt = not obeys
    bus = Asked(device)
    state, took_s = seen(bus, STOPPED)
    assert state is None
    assert took_s == pytest.approx(1.5, abs=0.01)
    assert bus.requests == []
    assert seen(Asked(with_heartbeat(100)), STOPPED)[0] is STOPPED


def test_a_node_that_does_not_answer_is_not_guarded_either() -> None:
    bus = Asked(booted())
    assert seen(bus, node_id=9)[0] is None
    assert bus.requests == []


def test_several_nodes_are_waited_for_together() -> None:
    assert seen_states({}, OPERATIONAL) == {}
    quick, slow = with_heartbeat(100), with_heartbeat(1200, node_id=5)
    bus = Asked(quick, slow)
    accesses = {node_id: NodeAccess(bus, node_id, profile("generic")) for node_id in (NODE, 5)}
    bus.send_nmt(NmtCommand.START, 0)
    started_s = bus.now_s()
    assert seen_states(accesses, OPERATIONAL) == {NODE: OPERATIONAL, 5: OPERATIONAL}
    assert bus.now_s() - started_s <= 1.3
    slow.ignores_nmt = True
    bus.send_nmt(NmtCommand.STOP, 0)
    started_s = bus.now_s()
    assert seen_states(accesses, STOPPED) == {NODE: STOPPED, 5: OPERATIONAL}
    assert bus.now_s() - started_s == pytest.approx(2 * 1.2 + 0.5, abs=0.02)


def test_a_node_with_a_state_object_is_asked_for_it() -> None:
    device = booted("gen4")
    device.set_value(0x1017, 0, b"\0\0")
    bus = Asked(device)
    bus.send_nmt(NmtCommand.START, NODE)
    started_s = bus.now_s()
    assert seen_states({NODE: NodeAccess(bus, NODE, profile("gen4"))}, OPERATIONAL) == {NODE: OPERATIONAL}
    assert bus.now_s() - started_s < 0.1
    assert bus.requests == []


@pytest.mark.parametrize(("axis", "told"), [(0, True), (1, True), (7, True), (8, False)])
def test_each_of_eight_axes_is_asked_whether_it_is_enabled(axis: int, told: bool) -> None:
    index = 0x6041 + 0x800 * axis
    text = family_eds("generic").read_text("utf-8")
    if axis:
        text += f"\n[{index:X}]\nParameterName=Statusword\nObjectType=0x7\nDataType=0x0006\nAccessType=ro\n"
    bus = VirtualTimeBus([booted(described=parse_eds(text.encode(), "axes.eds").dictionary)])
    bus.nodes[0].device.set_value(0x6041, 0, b"\x40\x02")  # switch on disabled
    assert why_it_may_move(bus, NODE) == ""
    assert ((index - 1, 0) in CONTROLWORDS) == told
    bus.nodes[0].device.set_value(index, 0, b"\x37\x02")
    assert why_it_may_move(bus, NODE) == (f"has operation enabled (0x{index:04X} is 0x0237)" if told else "")


def test_a_device_that_is_no_drive_is_not_enabled() -> None:
    described = {index: dictionary("generic")[index] for index in (0x1000, 0x1017)}
    assert why_it_may_move(VirtualTimeBus([booted(described=ObjectDictionary(described))]), NODE) == ""


@pytest.mark.parametrize(("index", "commands"), [(0x6040, True), (0x6840, True), (0x9840, True), (0xA040, False)])
def test_the_controlword_of_each_of_eight_axes_moves_it(index: int, commands: bool) -> None:
    assert ((index, 0) in CONTROLWORDS) == commands
    assert len(CONTROLWORDS) == 8


def test_a_drive_that_does_not_answer_is_asked_once() -> None:
    bus = VirtualTimeBus([booted()])
    started_s = bus.now_s()
    assert why_it_may_move(bus, 9) == "does not answer a read of its statusword (0x6041)"
    asked_s = bus.now_s() - started_s
    with pytest.raises(NoAnswer):
        bus.sdo(9).upload(0x6041, 0)
    assert asked_s == pytest.approx((bus.now_s() - started_s) / 2)

"""Signals and the plant: what moves by itself, and that TPDOs show it."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import Frame
from dvtcli.errors import InputFileError
from dvtcli.simulator.device.plant import DriveState, Plant, is_drive, next_state, state_of
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.signals import RowsError, SimulatedSignal
from dvtcli.simulator.network.station import SimulatedNode
from tests.simulator.bench import Client, booted
from tests.virtual_time import VirtualTimeBus


def at(text: str, *times_s: float) -> list[float]:
    shape = SimulatedSignal.parse(text).shape
    return [round(shape(time_s), 6) for time_s in times_s]


@pytest.mark.parametrize(
    ("text", "times_s", "values"),
    [
        ("606C=sine(1500,2s)", (0, 0.5, 1, 1.5, 2), [0, 1500, 0, -1500, 0]),
        ("606C:00=ramp(-10,10,4s)", (0, 1, 2, 3, 4), [-10, -5, 0, 5, -10]),
        ("6000:1=square(0,1,500ms)", (0, 0.2, 0.3, 0.5), [0, 0, 1, 0]),
        ("606c=const(-0x10)", (0, 100), [-16, -16]),
        ("606C=const(1.5)", (0,), [1.5]),
        ("606C=sine(1,1min)", (15,), [1]),
        ("606C=sine(1,4)", (1,), [1]),
    ],
)
def test_shapes(text: str, times_s: tuple[float, ...], values: list[float]) -> None:
    assert at(text, *times_s) == values


def test_an_object_is_named_in_hex() -> None:
    signal = SimulatedSignal.parse(" 6401:1F=const(0) ")
    assert (signal.index, signal.sub_index) == (0x6401, 0x1F)


def test_a_walk_stays_within_its_limits_and_is_the_same_every_time() -> None:
    times_s = [(step + 0.5) / 10 for step in range(500)]
    first = at("606C=walk(5,-20,30,100ms)", *times_s)
    assert first == at("606C=walk(5,-20,30,100ms)", *times_s)
    assert first[0] == 5
    assert -20 <= min(first) < max(first) <= 30
    assert max(abs(after - before) for before, after in pairwise(first)) <= 5
    assert at("606C=walk(5,-20,30,1ms)", 1e9)


def test_rows_of_a_file_hold_until_the_next(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,speed,current\n0,10,1\n0.5,20,2\n2,-30,3\n")
    assert at(f"606C=csv({path},speed)", 0, 0.4, 0.5, 1.9, 2, 50) == [10, 10, 20, 20, -30, -30]
    assert at(f"606C=csv({path},2)", 2) == [3]
    path.write_text("1,10\n2,20\n")
    assert at(f"606C=csv({path},1)", 0, 1, 2) == [10, 10, 20]


@pytest.mark.parametrize(
    "text",
    ["", "606C",
     "606C=tan(1,2)", "606C=sine(1)", "606C=sine(1,0s)", "606C=sine(x,1s)", "606C=sine(1,1h)", "6C=const(1)",
     "606C=walk(1,5,2,1s)", "606C=const()", "606C=csv(,1)", "606C=csv(a.csv)",
     "606C=sine(1,1s)x", "5:=const(1)", "606C=const(1e999)"],
)  # fmt: skip
def test_what_is_no_signal(text: str) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        SimulatedSignal.parse(text)


@pytest.mark.parametrize(
    ("body", "place"),
    [(b"", ""), (b"time,speed\n", ""), (b"0,a\n", ":1"), (b"t,v\n0,1\n\n0\n", ":4"), (b"0,nan\n", ":1"), (b"\xff", ""),
     (b"0," + b"9" * 200_000, "")],
)  # fmt: skip
def test_files_without_rows(tmp_path: Path, body: bytes, place: str) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(body)
    with pytest.raises(RowsError) as raised:
        SimulatedSignal.parse(f"606C=csv({path},1)")
    assert raised.value.place == f"{path}{place}"


def test_columns_that_a_file_does_not_have(tmp_path: Path) -> None:
    path = tmp_path / "a, b.csv"
    path.write_text("time,speed\n0,1\n")
    assert at(f"606C=csv({path},speed)", 0) == [1]
    with pytest.raises(RowsError, match="it has speed"):
        SimulatedSignal.parse(f"606C=csv({path},current)")
    with pytest.raises(RowsError, match=r"no column '7' with values.*it has speed"):
        SimulatedSignal.parse(f"606C=csv({path},7)")
    with pytest.raises(FileNotFoundError):
        SimulatedSignal.parse("606C=csv(nowhere.csv,1)")


def test_a_signal_may_name_its_node() -> None:
    assert [SimulatedSignal.parse(f"{node}606C:1=const(1)").node_id for node in ("", "5:", "0x7F:")] == [None, 5, 127]


@pytest.mark.parametrize("place", ["5FFF", "1008", "606C:5", "1017", "1800:2"])
def test_signals_need_an_object_that_holds_a_number(place: str) -> None:
    with pytest.raises(ValueError, match=r"has no object|from 2000 on"):
        SimulatedNode(booted()).animate([SimulatedSignal.parse(f"{place}=const(1)")])


def test_values_are_rounded_and_clipped_to_the_type() -> None:
    node = SimulatedNode(booted())
    node.animate([SimulatedSignal.parse("6041=const(99999)"), SimulatedSignal.parse("606C=const(-1.6)")])
    node.poll(0.0)
    assert node.device.value(0x6041) == b"\xff\xff"
    assert node.device.value(0x606C) == b"\xfe\xff\xff\xff"


def test_a_tpdo_on_change_follows_a_signal_within_its_inhibit_time() -> None:
    device = booted()
    client = Client.on(device)
    for write in ((0x1800, 1, 0xC0000181, 4), (0x1800, 3, 1000, 2), (0x1800, 1, 0x40000181, 4)):
        client.write(*write)
    bus = VirtualTimeBus([device], signals=[SimulatedSignal.parse("6041=ramp(0,1000,1s)")])
    bus.send(Frame(0, b"\x01\x01"))
    values = [int.from_bytes(frame.data, "little") for frame in bus.receive(0.95) if frame.can_id == 0x181]
    assert len(values) == 10
    assert values == sorted(values)
    assert {after - before for before, after in pairwise(values)} <= {90, 100, 110}


@pytest.mark.parametrize(
    ("state", "controlword", "after"),
    [
        ("SWITCH_ON_DISABLED", 0x06, "READY_TO_SWITCH_ON"),
        ("SWITCH_ON_DISABLED", 0x0F, "SWITCH_ON_DISABLED"),
        ("READY_TO_SWITCH_ON", 0x07, "SWITCHED_ON"),
        ("READY_TO_SWITCH_ON", 0x0F, "OPERATION_ENABLED"),
        ("READY_TO_SWITCH_ON", 0x02, "SWITCH_ON_DISABLED"),
        ("SWITCHED_ON", 0x0F, "OPERATION_ENABLED"),
        ("SWITCHED_ON", 0x06, "READY_TO_SWITCH_ON"),
        ("OPERATION_ENABLED", 0x07, "SWITCHED_ON"),
        ("OPERATION_ENABLED", 0x06, "READY_TO_SWITCH_ON"),
        ("OPERATION_ENABLED", 0x02, "QUICK_STOP_ACTIVE"),
        ("OPERATION_ENABLED", 0x00, "SWITCH_ON_DISABLED"),
        ("QUICK_STOP_ACTIVE", 0x06, "QUICK_STOP_ACTIVE"),
        ("QUICK_STOP_ACTIVE", 0x00, "SWITCH_ON_DISABLED"),
        ("FAULT", 0x0F, "FAULT"),
        ("FAULT", 0x80, "FAULT"),
        ("OPERATION_ENABLED", 0x80, "OPERATION_ENABLED"),
        ("OPERATION_ENABLED", 0x0F, "OPERATION_ENABLED"),
        ("SWITCHED_ON", 0x02, "SWITCH_ON_DISABLED"),
        ("SWITCHED_ON", 0x00, "SWITCH_ON_DISABLED"),
        ("READY_TO_SWITCH_ON", 0x06, "READY_TO_SWITCH_ON"),
        ("QUICK_STOP_ACTIVE", 0x0F, "QUICK_STOP_ACTIVE"),
        ("NOT_READY_TO_SWITCH_ON", 0x06, "NOT_READY_TO_SWITCH_ON"),
    ],
)
def test_the_state_machine(state: str, controlword: int, after: str) -> None:
    assert next_state(DriveState[state], controlword) is DriveState[after]


def drive() -> tuple[StrictDevice, Plant]:
    """A drive that stands, without power, at 0."""
    device = booted()
    Client.on(device).write(0x6083, 0, 1000, 4)
    for place, size in ((0x6040, 2), (0x6041, 2), (0x606C, 4), (0x6064, 4)):
        device.set_value(place, 0, bytes(size))
    return device, Plant(device)


def order(device: StrictDevice, plant: Plant, controlword: int, now_s: float) -> int:
    Client.on(device).write(0x6040, 0, controlword, 2)
    assert plant.due_s == 0.0
    plant.poll(now_s)
    return int.from_bytes(device.value(0x6041), "little")


def velocity(device: StrictDevice, index: int = 0x606C) -> int:
    return int.from_bytes(device.value(index), "little", signed=True)


def enabled() -> tuple[StrictDevice, Plant]:
    device, plant = drive()
    plant.poll(0.0)
    for word in (0x06, 0x07, 0x0F):
        order(device, plant, word, 0.0)
    return device, plant


def run(plant: Plant, until_s: float) -> None:
    """Poll as a node does, from 0 s on."""
    while plant.due_s <= until_s:
        plant.poll(plant.due_s)


def test_a_drive_without_a_state_is_ready_by_itself_and_then_obeys() -> None:
    device, plant = drive()
    assert plant.due_s == 0.0
    plant.poll(0.0)
    assert int.from_bytes(device.value(0x6041), "little") == 0x1640
    words = [order(device, plant, word, 0.0) for word in (0x0F, 0x06, 0x07, 0x0F)]
    assert words == [0x1640, 0x1631, 0x1633, 0x1637]


def test_target_velocity_moves_the_actual_one_and_position_integrates() -> None:
    device, plant = enabled()
    Client.on(device).write(0x60FF, 0, 500, 4)
    seen = []
    for step in range(101):
        plant.poll(step / 100)
        seen.append(velocity(device))
    assert seen[:4] == [0, 10, 20, 30]
    assert seen[25] == 250
    assert seen[-1] == 500
    assert velocity(device, 0x6064) == 375  # half a second of acceleration and half at 500
    assert order(device, plant, 0x06, 1.25) == 0x0231
    assert velocity(device) == 250


def test_halt_stops_and_clearing_it_goes_on() -> None:
    device, plant = enabled()
    Client.on(device).write(0x60FF, 0, 100, 4)
    run(plant, 1.0)
    assert velocity(device) == 100
    order(device, plant, 0x010F, 1.0)
    run(plant, 2.0)
    assert (velocity(device), device.value(0x6041)) == (0, bytes.fromhex("3716"))
    order(device, plant, 0x0F, 2.0)
    run(plant, 3.0)
    assert velocity(device) == 100


def test_a_quick_stop_ends_without_voltage() -> None:
    """605A is not there: its default, 2, slows down and then switches on disabled (CiA 402-2, 8.4.3)."""
    device, plant = enabled()
    Client.on(device).write(0x60FF, 0, 100, 4)
    run(plant, 1.0)
    assert order(device, plant, 0x02, 1.0) & 0x6F == 0x07
    run(plant, 1.05)
    assert (plant.state, velocity(device) > 0) == (DriveState.QUICK_STOP_ACTIVE, True)
    run(plant, 2.0)
    assert (plant.state, velocity(device)) == (DriveState.SWITCH_ON_DISABLED, 0)


def test_the_mode_display_follows_the_mode() -> None:
    device, plant = drive()
    Client.on(device).write(0x6060, 0, 9, 1)
    plant.poll(0.0)
    assert device.value(0x6061) == b"\x09"


def test_a_fault_needs_the_rising_edge_of_bit_7() -> None:
    device, _ = drive()
    device.set_value(0x6041, 0, b"\x0f\x00")
    plant = Plant(device)
    assert plant.state is DriveState.FAULT_REACTION_ACTIVE
    plant.poll(0.0)
    assert order(device, plant, 0x06, 0.1) & 0x6F == 0x08
    assert order(device, plant, 0x80, 0.2) & 0x6F == 0x40
    assert order(device, plant, 0x06, 0.3) & 0x6F == 0x21
    device.set_value(0x6040, 0, b"\x80\x00")
    device.set_value(0x6041, 0, b"\x08\x00")
    plant.poll(0.4)
    assert plant.state is DriveState.FAULT


def test_a_drive_is_as_its_file_says_until_it_is_ordered_something() -> None:
    device = booted()
    plant = Plant(device)
    run(plant, 10.0)
    assert (plant.due_s, velocity(device), device.value(0x6041)) == (float("inf"), -1500, b"\x50\x02")
    Client.on(device).write(0x60FF, 0, 500, 4)
    plant.poll(10.0)
    run(plant, 11.0)
    assert (velocity(device), plant.state) == (0, DriveState.SWITCH_ON_DISABLED), (
        "it is not enabled, and comes to a stand"
    )
    device.nmt(NmtCommand.RESET_NODE)
    run(plant, 20.0)
    assert (velocity(device), device.value(0x6041)) == (-1500, b"\x50\x02")


def test_a_drive_that_stands_wants_no_polls() -> None:
    device, plant = enabled()
    run(plant, 1.0)
    assert plant.due_s == float("inf")
    Client.on(device).write(0x60FF, 0, 10, 4)
    run(plant, 2.0)
    assert plant.due_s < float("inf")  # it turns, and 6064 with it
    Client.on(device).write(0x60FF, 0, 0, 4)
    run(plant, 3.0)
    assert plant.due_s == float("inf")


def test_a_signal_wins_over_the_plant() -> None:
    device = booted()
    bus = VirtualTimeBus([device], signals=[SimulatedSignal.parse("606C=const(60)")])
    bus.sdo(1).download(0x60FF, 0, bytes(4))
    bus.sdo(1).download(0x6040, 0, b"\x06\x00")
    before = velocity(device, 0x6064)
    bus.sleep(1.0)
    assert velocity(device) == 60
    assert velocity(device, 0x6064) - before == pytest.approx(60, abs=2)


def test_virtual_time_is_the_same_every_time() -> None:
    seen = []
    for _ in range(2):
        bus = VirtualTimeBus([booted()], signals=[SimulatedSignal.parse("606C=walk(50,-500,500,20ms)")])
        values = []
        for _ in range(20):
            bus.sleep(0.037)
            values.append(bus.sdo(1).upload(0x606C, 0))
        seen.append(values)
    assert seen[0] == seen[1]
    assert len(set(seen[0])) > 10


def test_what_is_no_drive() -> None:
    device = booted("lely")
    assert not is_drive(device)
    node = SimulatedNode(device)
    node.animate()
    node.poll(0.0)
    Client.on(device).write(0x1017, 0, 0, 2)
    node.poll(1.0)
    assert node.next_poll_s() is None


@pytest.mark.parametrize("state", list(DriveState))
def test_a_statusword_tells_its_state(state: DriveState) -> None:
    assert state_of(state | 0x1210) is state
    assert state_of(0x1237) is DriveState.OPERATION_ENABLED


@pytest.mark.parametrize("family", ["generic", "gen4", "espac", "tmcm", "roboteq"])
def test_every_drive_family_has_a_plant(family: str) -> None:
    """Where a motor is tied to an application object, that one commands it."""
    tied = family in ("gen4", "espac")
    control, target = ((0x2020, 1), (0x2020, 3)) if tied else ((0x6040, 0), (0x60FF, 0))
    device = booted(family)
    node = SimulatedNode(device)
    node.animate()
    device.nmt(NmtCommand.START)
    for word in (0x06, 0x07, 0x0F):
        device.set_value(*control, word.to_bytes(2, "little"))
        node.poll(0.0 if word == 0x06 else word / 100)
    device.set_value(*target, (1000).to_bytes(4, "little"))
    assert node.next_poll_s() == 0.0
    node.poll(2.0)
    assert velocity(device) > 0


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="this system has no /dev/zero")
def test_a_device_or_a_large_file_is_no_signal(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="/dev/zero"):
        SimulatedSignal.parse("606C=csv(/dev/zero,1)")
    with (large := tmp_path / "large.csv").open("wb") as file:
        file.truncate((16 << 20) + 1)
    with pytest.raises(InputFileError, match="larger than 16 MiB"):
        SimulatedSignal.parse(f"606C=csv({large},1)")

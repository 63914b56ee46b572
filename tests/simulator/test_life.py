"""A device's life: boot-up, NMT, SYNC, RPDOs, heartbeat, store, restore and resets."""

from __future__ import annotations

import pytest

from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.station import SimulatedNode
from tests.simulator.bench import Aborted, Client, booted

SAVE, LOAD = 0x65766173, 0x64616F6C
BOOT_UP = Frame(0x701, b"\0")


def operational(family: str = "generic") -> StrictDevice:
    device = booted(family)
    device.nmt(NmtCommand.START)
    return device


def number(device: StrictDevice, index: int, sub_index: int = 0) -> int:
    return int.from_bytes(device.value(index, sub_index), "little")


def test_boot_up() -> None:
    fresh = booted()
    device = StrictDevice(fresh.dictionary, fresh.family, 1)
    assert device.state is NmtState.INITIALISING
    device.boot_up()
    assert device.take_outbox() == [BOOT_UP]
    assert device.take_outbox() == []
    assert device.state is NmtState.PRE_OPERATIONAL


@pytest.mark.parametrize("node_id", [0, 128])
def test_node_id_range(node_id: int) -> None:
    fresh = booted()
    with pytest.raises(ValueError, match="node-ID"):
        StrictDevice(fresh.dictionary, fresh.family, node_id)


@pytest.mark.parametrize(
    ("command", "state"),
    [
        (NmtCommand.START, NmtState.OPERATIONAL),
        (NmtCommand.STOP, NmtState.STOPPED),
        (NmtCommand.ENTER_PRE_OPERATIONAL, NmtState.PRE_OPERATIONAL),
        (0x33, NmtState.PRE_OPERATIONAL),
    ],
)
def test_nmt_states(command: int, state: NmtState) -> None:
    device = booted()
    device.nmt(command)
    assert device.state is state


@pytest.mark.parametrize("command", [NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION])
@pytest.mark.parametrize("before", [NmtState.OPERATIONAL, NmtState.STOPPED])
def test_resets_boot_up_into_pre_operational(command: NmtCommand, before: NmtState) -> None:
    device = booted()
    device.state = before
    device.nmt(command)
    assert device.take_outbox() == [BOOT_UP]
    assert device.state is NmtState.PRE_OPERATIONAL


def test_f2_reset_communication_reverts_communication_objects_only() -> None:
    device = booted()
    client = Client.on(device)
    client.write(0x1800, 2, 1, 1)
    client.write(0x2003, 0, 77, 2)
    device.nmt(NmtCommand.RESET_COMMUNICATION)
    assert client.number(0x1800, 2) == 255
    assert client.number(0x2003) == 77
    device.nmt(NmtCommand.RESET_NODE)
    assert client.number(0x2003) == 0


@pytest.mark.parametrize(
    ("sub_index", "communication", "profile", "manufacturer"),
    [(1, 1, 100, 77), (2, 1, 5000, 0), (3, 255, 100, 0)],
)
def test_store_covers_its_area(sub_index: int, communication: int, profile: int, manufacturer: int) -> None:
    device = booted()
    client = Client.on(device)
    client.write(0x1800, 2, 1, 1)
    client.write(0x6083, 0, 100, 4)
    client.write(0x2003, 0, 77, 2)
    client.write(0x1010, sub_index, SAVE, 4)
    device.nmt(NmtCommand.RESET_NODE)
    assert client.number(0x1800, 2) == communication
    assert client.number(0x6083) == profile
    assert client.number(0x2003) == manufacturer


def test_restore_takes_effect_after_the_reset() -> None:
    device = booted()
    client = Client.on(device)
    client.write(0x1800, 2, 1, 1)
    client.write(0x1010, 1, SAVE, 4)
    client.write(0x1011, 1, LOAD, 4)
    assert client.number(0x1800, 2) == 1
    device.nmt(NmtCommand.RESET_COMMUNICATION)
    assert client.number(0x1800, 2) == 1
    device.nmt(NmtCommand.RESET_NODE)
    assert client.number(0x1800, 2) == 255
    device.nmt(NmtCommand.RESET_NODE)
    assert client.number(0x1800, 2) == 255


def test_restore_of_communication_needs_only_that_reset() -> None:
    device = booted()
    client = Client.on(device)
    client.write(0x1800, 2, 1, 1)
    client.write(0x1010, 2, SAVE, 4)
    client.write(0x1011, 2, LOAD, 4)
    device.nmt(NmtCommand.RESET_COMMUNICATION)
    assert client.number(0x1800, 2) == 255


def test_a_failed_store_keeps_what_was_stored() -> None:
    device = booted()
    client = Client.on(device)
    client.write(0x1800, 2, 1, 1)
    device.areas.fails = True
    with pytest.raises(Aborted, match="06060000"):
        client.write(0x1010, 1, SAVE, 4)
    device.nmt(NmtCommand.RESET_NODE)
    assert client.number(0x1800, 2) == 255


def test_save_command_of_a_family_without_1010() -> None:
    device = booted("roboteq")
    client = Client.on(device)
    with pytest.raises(Aborted, match="06020000"):
        client.write(0x1010, 1, SAVE, 4)
    client.write(0x1800, 2, 1, 1)
    client.write(0x2017, 0, 0, 1)
    device.nmt(NmtCommand.RESET_NODE)
    assert client.number(0x1800, 2) == 1


def test_heartbeats_carry_the_state_and_keep_the_period() -> None:
    device = booted()
    for cob_id in (0x1800, 0x1801):  # only heartbeats
        Client.on(device).write(cob_id, 1, 0xC0000000, 4)
    assert device.services.poll(10.0) == [Frame(0x701, b"\x7f")]
    assert device.services.poll(10.4) == []
    assert device.services.next_poll_s() == 10.5
    device.nmt(NmtCommand.START)
    assert device.services.poll(10.5) == [Frame(0x701, b"\x05")]
    device.nmt(NmtCommand.STOP)
    assert device.services.poll(11.0) == [Frame(0x701, b"\x04")]


def test_heartbeat_time_0_switches_heartbeats_off_and_a_new_one_counts_at_once() -> None:
    device = booted()
    device.services.poll(0.0)
    Client.on(device).write(0x1017, 0, 0, 2)
    assert device.services.poll(100.0) == []
    assert device.services.next_poll_s() is None
    Client.on(device).write(0x1017, 0, 50, 2)
    assert device.services.poll(100.0) == [Frame(0x701, b"\x7f")]


def test_late_heartbeats_are_not_made_up_for() -> None:
    device = booted()
    device.services.poll(0.0)
    assert len(device.services.poll(10.2)) == 1
    assert device.services.poll(10.3) == []
    assert device.services.next_poll_s() == 10.7


def test_nmt_commands_before_the_boot_up_are_ignored() -> None:
    fresh = booted()
    device = StrictDevice(fresh.dictionary, fresh.family, 1)
    device.nmt(NmtCommand.START)
    assert device.state is NmtState.INITIALISING
    assert device.services.poll(0.0) == []


def test_sync_does_nothing_outside_operational() -> None:
    device = booted()
    Client.on(device).write(0x1800, 2, 1, 1)
    assert device.services.sync() == []
    device.nmt(NmtCommand.START)
    assert device.services.sync() == [Frame(0x181, b"\x50\x02")]


def test_sync_counts_by_transmission_type() -> None:
    device = operational()
    Client.on(device).write(0x1800, 2, 3, 1)
    assert [len(device.services.sync()) for _ in range(7)] == [0, 0, 1, 0, 0, 1, 0]


def test_sync_start_value_delays_the_first_frame() -> None:
    device = operational()
    client = Client.on(device)
    client.write(0x1800, 1, 0xC0000181, 4)
    client.write(0x1800, 6, 3, 1)
    client.write(0x1800, 2, 2, 1)
    client.write(0x1800, 1, 0x40000181, 4)
    assert [len(device.services.sync(counter)) for counter in (1, 2, 3, 4, 5, 6, 7)] == [0, 0, 1, 0, 1, 0, 1]


def test_type_0_is_sent_on_change_at_the_next_sync() -> None:
    device = operational()
    Client.on(device).write(0x1800, 2, 0, 1)
    assert [len(device.services.sync()) for _ in range(3)] == [1, 0, 0]
    device.set_value(0x6041, 0, b"\x00\x00")
    assert device.services.sync() == [Frame(0x181, b"\0\0")]
    assert device.services.sync() == []


def test_event_driven_and_disabled_tpdos_ignore_sync() -> None:
    assert operational().services.sync() == []


def test_29_bit_pdos() -> None:
    device = operational()
    client = Client.on(device)
    client.write(0x1802, 1, 0x60012345, 4)
    assert [(frame.can_id, frame.extended) for frame in device.services.sync()] == [(0x12345, True)]


def test_rpdo_lands_in_the_dictionary_at_once_when_event_driven() -> None:
    device = operational()
    assert device.services.receive(Frame(0x201, b"\x1f\x00")) == []
    assert number(device, 0x6040) == 0x1F


def test_rpdo_is_ignored_outside_operational_and_as_a_remote_frame() -> None:
    device = booted()
    device.services.receive(Frame(0x201, b"\x1f\x00"))
    device.nmt(NmtCommand.START)
    device.services.receive(Frame(0x201, b"\x1f\x00", remote=True))
    device.services.receive(Frame(0x201, b"\x1f\x00", extended=True))
    assert number(device, 0x6040) == 0x0F


@pytest.mark.parametrize(("family", "syncs"), [("generic", 1), ("tmcm", 3)])
def test_synchronous_rpdo_waits_for_its_sync(family: str, syncs: int) -> None:
    device = operational(family)
    Client.on(device).write(0x1400, 2, 3, 1)
    device.services.receive(Frame(0x201, b"\x1f\x00"))
    for _ in range(syncs):
        assert number(device, 0x6040) == 0x0F
        device.services.sync()
    assert number(device, 0x6040) == 0x1F


def test_f3_short_rpdo_is_not_applied() -> None:
    device = operational()
    assert device.services.receive(Frame(0x201, b"\x1f")) == [Frame(0x81, bytes.fromhex("1082110000000000"))]
    assert number(device, 0x6040) == 0x0F


def test_f3_long_rpdo_is_applied_by_its_first_bytes() -> None:
    device = operational()
    assert device.services.receive(Frame(0x201, b"\x1f\x00\xff")) == [Frame(0x81, bytes.fromhex("2082110000000000"))]
    assert number(device, 0x6040) == 0x1F


def test_emcy_goes_where_1014_says() -> None:
    device = operational()
    client = Client.on(device)
    for raw in (0x8000_0081, 0xC5):
        client.write(0x1014, 0, raw, 4)
    assert [frame.can_id for frame in device.services.receive(Frame(0x201, b""))] == [0xC5]
    client.write(0x1014, 0, 0x80000081, 4)
    assert device.services.receive(Frame(0x201, b"")) == []


def test_a_short_entry_leaves_the_rest_of_its_object() -> None:
    device = operational()
    client = Client.on(device)
    for write in ((0x1602, 0, 0, 1), (0x1602, 1, 0x20000008, 4), (0x1602, 0, 1, 1), (0x1402, 1, 0x401, 4)):
        client.write(*write)
    device.services.receive(Frame(0x401, b"\xee"))
    assert number(device, 0x2000) == 0x112233EE


def test_dummies_and_bits_are_taken_apart_by_bit_position() -> None:
    device = booted("gen4")
    client = Client.on(device)
    rows = [0x00010001, 0x21230001, 0x00010001, 0x21240001, 0x22210010]
    for sub_index, raw in enumerate(rows, 1):
        client.write(0x1602, sub_index, raw, 4)
    client.write(0x3300, 0, 0, 1)
    client.write(0x1602, 0, 5, 1)
    client.write(0x1402, 1, 0x401, 4)
    device.nmt(NmtCommand.START)
    assert device.services.receive(Frame(0x401, (0b1010 | 0x1234 << 4).to_bytes(3, "little"))) == []
    assert (number(device, 0x2123), number(device, 0x2124), number(device, 0x2221)) == (1, 1, 0x1234)


def test_a_restore_happens_once() -> None:
    device = booted()
    client = Client.on(device)
    client.write(0x1011, 1, LOAD, 4)
    device.nmt(NmtCommand.RESET_NODE)
    client.write(0x1800, 2, 1, 1)
    client.write(0x1010, 2, SAVE, 4)
    device.nmt(NmtCommand.RESET_NODE)
    assert client.number(0x1800, 2) == 1


def test_live_values_are_not_stored() -> None:
    device = booted()
    device.set_value(0x6041, 0, b"\0\0")
    Client.on(device).write(0x1010, 1, SAVE, 4)
    device.nmt(NmtCommand.RESET_NODE)
    assert number(device, 0x6041) == 0x0250


def test_a_reset_ends_a_transfer() -> None:
    node = SimulatedNode(booted())
    node.handle(Frame(0x601, bytes.fromhex("4008100000000000")))
    node.handle(Frame(0x000, b"\x82\x01"))
    assert node.handle(Frame(0x601, bytes.fromhex("6000000000000000"))) == [
        Frame(0x581, bytes.fromhex("8000000001000405"))
    ]


@pytest.mark.parametrize("frame", [b"\x01", b"\x01\x02", b"\x01\x01\x00"], ids=["short", "other node", "long"])
def test_nmt_frames_for_others_or_malformed_are_ignored(frame: bytes) -> None:
    node = SimulatedNode(booted())
    assert node.handle(Frame(0x000, frame)) == []
    assert node.device.state is NmtState.PRE_OPERATIONAL

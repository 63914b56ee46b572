"""Devices whose mapping entries have their fields the other way round: the same commands, other words on the wire."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.device.node import Node
from dvtcli.device.quirks import ReversedEntries, as_device, as_standard
from dvtcli.domain.pdo import Pdo, PdoMappingEntry
from dvtcli.domain.profile import GENERIC
from dvtcli.errors import DeviceRefused
from dvtcli.simulator.device.strict_device import ReversedDevice
from dvtcli.simulator.network.family_file import load_family
from dvtcli.simulator.network.twin_bus import TwinBus
from tests.device.test_reading_and_storing import Table
from tests.laws.bench import NODE, DirectBus, DirectSdo, dictionary

TPDO1 = Pdo.parse("tpdo1")
STATUSWORD, POSITION = PdoMappingEntry(0x6041, 0, 16), PdoMappingEntry(0x6064, 0, 32)


def device(family: str = "generic") -> ReversedDevice:
    made = ReversedDevice(dictionary(family), load_family(family), NODE)
    made.boot_up()
    made.take_outbox()
    return made


def test_the_words_of_an_entry() -> None:
    assert as_device(bytes.fromhex("20 01 64 60")) == bytes.fromhex("64 60 01 20")
    assert as_standard(bytes.fromhex("64 60 01 20")) == bytes.fromhex("20 01 64 60")


def test_a_count_of_four_bytes_is_not_turned_round() -> None:
    count, entry = bytes.fromhex("02 00 00 00"), bytes.fromhex("64 60 01 20")
    channel = ReversedEntries(Table({(0x1A00, 0): count, (0x1A00, 1): entry, (0x1800, 1): entry}))
    assert (channel.upload(0x1A00, 0), channel.upload(0x1A00, 1)) == (count, as_standard(entry))
    assert channel.upload(0x1800, 1) == entry


def test_what_is_mapped_reads_back_and_is_reversed_on_the_wire() -> None:
    bus = DirectBus.of(device())
    node = Node(bus, NODE, dictionary("generic"), replace(GENERIC, reversed_entries=True))
    before = node.pdo(TPDO1)
    assert before.mapping == Node(DirectBus.of(device()), NODE, profile=node.profile).pdo(TPDO1).mapping
    node.configure({TPDO1: replace(before, mapping=(STATUSWORD, POSITION))})
    assert isinstance(bus.channel, DirectSdo)
    written = {sub: data for index, sub, data in bus.channel.writes if index == 0x1A00 and sub}
    assert written == {1: bytes.fromhex("41 60 00 10"), 2: bytes.fromhex("64 60 00 20")}
    assert node.pdo(TPDO1).mapping == (STATUSWORD, POSITION)
    node.undo()
    assert node.pdo(TPDO1) == before


def test_without_the_profile_such_a_device_refuses_and_keeps_what_it_had() -> None:
    bus = DirectBus.of(device())
    raw = [bus.sdo(NODE).upload(0x1A00, sub) for sub in range(3)]
    node = Node(bus, NODE, dictionary("generic"), GENERIC)
    with pytest.raises(DeviceRefused):
        node.configure({TPDO1: replace(node.pdo(TPDO1), mapping=(POSITION, STATUSWORD))}, force=True)
    assert [bus.sdo(NODE).upload(0x1A00, sub) for sub in range(3)] == raw


def test_a_twin_of_such_a_device_has_its_order() -> None:
    real = device()
    described, family = dictionary("generic"), load_family("generic")

    bus = DirectBus.of(real)
    twin = TwinBus(bus, lambda node_id, backing: ReversedDevice(described, family, node_id, backing=backing))
    try:
        node = Node(twin, NODE, described, replace(GENERIC, reversed_entries=True))
        before = node.pdo(TPDO1)
        assert before.mapping
        node.configure({TPDO1: replace(before, mapping=(POSITION,))})
        assert node.pdo(TPDO1).mapping == (POSITION,)
        assert isinstance(bus.channel, DirectSdo)
        assert bus.channel.writes == []
    finally:
        twin.close()

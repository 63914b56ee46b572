"""The pins of a group of virtual PDOs, as a device with few, many or odd ones tells them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.device.node import Node
from dvtcli.device.virtual_pdos import group_names, names_objects, read_pins
from dvtcli.domain.profile import GENERIC, VpdoGroup
from dvtcli.errors import DvtcliError, SdoProtocolError
from tests.device.test_reading_and_storing import Table, Values
from tests.laws.bench import NODE, DirectBus, booted

PINS = VpdoGroup(0x3300, ((0x2100, 0x21FE),), 0x21FF)


def node_of(values: Values) -> tuple[Node, Table]:
    table = Table(values)
    return Node(DirectBus(booted(), table), NODE, profile=replace(GENERIC, vpdo={"digital-in": PINS})), table


def pins(count: int) -> Values:
    return {(0x3300, pin): (0x2100 + pin - 1).to_bytes(2, "little") for pin in range(1, count + 1)}


@pytest.mark.parametrize(("active", "there"), [(0, 0), (0, 3), (2, 3), (9, 3), (1, 0xFE), (0xFF, 0xFF)])
def test_there_are_as_many_pins_as_sub_indices(active: int, there: int) -> None:
    node, table = node_of({(0x3300, 0): bytes([active]), **pins(there)})
    held = read_pins(node, "digital-in")
    assert held.values == tuple(0x2100 + pin for pin in range(min(there, 0xFE)))
    assert held.active == min(active, there, 0xFE)
    assert (0x3300, 0xFF) not in table.reads


@pytest.mark.parametrize(
    ("index", "sub_index", "names"), [(0x3300, 1, True), (0x3300, 0xFE, True), (0x3300, 0, False), (0x3301, 1, False)]
)
def test_a_pin_names_an_object_and_the_count_and_other_objects_do_not(index: int, sub_index: int, names: bool) -> None:
    assert names_objects(node_of({})[0], index, sub_index) == names


def test_a_pin_holds_two_bytes() -> None:
    node, _ = node_of({(0x3300, 0): b"\1", (0x3300, 1): b"\0\x21\1"})
    with pytest.raises(SdoProtocolError, match="0x3300:01 answered 3 bytes"):
        read_pins(node, "digital-in")


def test_a_group_that_the_family_lacks_is_named_with_those_it_has() -> None:
    node, table = node_of({})
    assert group_names(node) == ["digital-in"]
    with pytest.raises(DvtcliError, match="node 1 has no virtual PDOs called 'motor'; it has digital-in"):
        read_pins(node, "motor")
    assert table.reads == []

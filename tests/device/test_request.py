"""What a user wants of a PDO is a value; what it comes to is found out on the device, lengths first."""

from __future__ import annotations

import pytest

from dvtcli.device.node import Node
from dvtcli.domain.object_syntax import MappedObject, Skipped
from dvtcli.domain.pdo import Pdo, PdoMappingEntry
from dvtcli.domain.profile import GENERIC
from dvtcli.domain.request import AnyPdoRequest, Cleared, PdoRequest, Switched
from dvtcli.errors import RuleError, UsageError
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary

TPDO1, TPDO2, RPDO1 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2"), Pdo.parse("rpdo1")
STATUSWORD, POSITION = PdoMappingEntry(0x6041, 0, 16), PdoMappingEntry(0x6064, 0, 32)


def node(*, eds: bool = True) -> tuple[Node, DirectSdo]:
    device = booted()
    channel = DirectSdo(device)
    return Node(DirectBus(device, channel), NODE, dictionary("generic") if eds else None, GENERIC), channel


def test_a_request_without_objects_keeps_the_mapping() -> None:
    one, _ = node()
    before = one.pdo(TPDO1)
    one.configure({TPDO1: PdoRequest(event_timer=70)})
    assert one.pdo(TPDO1) == before.with_parameters(event_timer=70)


def test_objects_come_as_words_without_a_length_as_entries_and_as_gaps() -> None:
    one, _ = node()
    one.configure({TPDO1: PdoRequest(enabled=True, objects=(MappedObject(0x6041, 0), POSITION))})
    assert one.pdo(TPDO1).mapping == (STATUSWORD, POSITION)
    one.configure({RPDO1: PdoRequest(objects=(Skipped(16), MappedObject(0x6040, 0, 16)))})
    first, last = one.pdo(RPDO1).mapping
    assert (first.is_dummy, first.bits, last) == (True, 16, PdoMappingEntry(0x6040, 0, 16))


@pytest.mark.parametrize("want", [Switched(enabled=False), Cleared()])
def test_switching_and_clearing_touch_nothing_else(want: AnyPdoRequest) -> None:
    one, _ = node()
    one.configure({TPDO1: Switched(enabled=True)})
    before = one.pdo(TPDO1)
    one.configure({TPDO1: want})
    held = one.pdo(TPDO1)
    assert held.communication == before.disabled().communication
    assert held.mapping == (() if want == Cleared() else before.mapping)


def test_one_want_may_be_for_several_pdos_and_wants_are_equal_by_value() -> None:
    one, _ = node()
    assert PdoRequest(event_timer=5) == PdoRequest(event_timer=5)
    one.configure({TPDO1: Switched(enabled=True), TPDO2: Switched(enabled=True)})
    applied = one.configure(dict.fromkeys([TPDO1, TPDO2], Switched(enabled=False)))
    assert [change.label for change in applied.plan.changes] == ["TPDO1", "TPDO2"]
    assert not one.pdo(TPDO1).enabled
    assert not one.pdo(TPDO2).enabled


def test_lengths_that_no_file_tells_are_read_once_and_before_the_pdo() -> None:
    one, channel = node(eds=False)
    one.configure({TPDO1: PdoRequest(objects=(MappedObject(0x6041, 0), MappedObject(0x6064, 0)))})
    assert channel.reads[:3] == [(0x6041, 0), (0x6064, 0), (0x1800, 1)]
    assert one.pdo(TPDO1).mapping == (STATUSWORD, POSITION)


def test_an_object_that_the_file_lacks_breaks_a_rule_and_one_of_unknown_length_is_a_usage_error() -> None:
    with_file, channel = node()
    with pytest.raises(RuleError, match="TPDO1 not changed"):
        with_file.configure({TPDO1: PdoRequest(objects=(MappedObject(0x5FFF, 1),))})
    without, other = node(eds=False)
    with pytest.raises(UsageError, match="TPDO1: the length of 5FFF:01 is not known; write 5FFF:01/BITS"):
        without.configure({TPDO1: PdoRequest(objects=(MappedObject(0x5FFF, 1),))})
    assert (channel.writes, other.writes) == ([], [])

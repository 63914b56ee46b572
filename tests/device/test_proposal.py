"""What the rules are given of a node: read where a rule looks at it, and as the node says it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.device.node import Node
from dvtcli.device.proposal import LazyMapping, proposal
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoMappingEntry
from dvtcli.domain.request import PdoRequest, Switched
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary

TPDO1, TPDO2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")
SYNC, EMCY = (0x1005, 0), (0x1014, 0)


def drive(*, eds: bool = True) -> tuple[Node, DirectSdo]:
    device = booted()
    channel = DirectSdo(device)
    return Node(DirectBus(device, channel), NODE, dictionary("generic") if eds else None), channel


def says(channel: DirectSdo, place: tuple[int, int], number: int) -> None:
    channel.device.set_value(*place, number.to_bytes(4, "little"))


@pytest.mark.parametrize("place", [SYNC, EMCY])
def test_auto_is_not_what_sync_or_emcy_has_on_this_device(place: tuple[int, int]) -> None:
    node, channel = drive()
    node.configure({TPDO1: Switched(enabled=False)})
    says(channel, place, 0x181)
    node.configure({TPDO1: PdoRequest(enabled=True, cob_id="auto")})
    assert node.pdo(TPDO1).communication.cob_id.can_id == 0x680


def test_a_can_id_that_emcy_has_left_may_be_kept() -> None:
    node, channel = drive()
    says(channel, EMCY, 0xE1)
    says(channel, (0x1800, 1), 0x8000_0000 | 0x080 + NODE)
    node.configure({TPDO1: PdoRequest(enabled=True)})
    assert node.pdo(TPDO1).communication.cob_id == CobId(0x080 + NODE, valid=True)


def test_services_are_asked_for_once_and_where_a_rule_looks_at_them() -> None:
    node, channel = drive()
    node.configure({TPDO1: PdoRequest(enabled=False, event_timer=77)})
    assert not {SYNC, EMCY} & set(channel.reads)
    for times, asked in enumerate((PdoRequest(cob_id=0x690, enabled=True), PdoRequest(event_timer=78)), 1):
        node.configure({TPDO1: asked})
        assert [channel.reads.count(place) for place in (SYNC, EMCY)] == [times, times]


@pytest.mark.parametrize("eds", [True, False])
def test_lengths_are_learnt_where_no_file_tells_them_and_the_mapping_changes(eds: bool) -> None:
    node, _ = drive(eds=eds)
    now = node.pdo(TPDO1)
    more = replace(now, mapping=(PdoMappingEntry(0x6041, 0, 16), PdoMappingEntry(0x6064, 0, 32)))
    assert proposal(node, TPDO1, now, more).lengths == ({} if eds else {(0x6041, 0): 16, (0x6064, 0): 32})
    assert proposal(node, TPDO1, now, replace(now, communication=more.communication)).lengths == {}


def test_the_other_pdos_are_counted_and_not_read() -> None:
    node, channel = drive()
    now = node.pdo(TPDO1)
    others = proposal(node, TPDO1, now, now).others
    assert len(others) == len(node.present()) - 1
    assert (0x1801, 5) not in channel.reads
    assert others[TPDO2] == node.pdo(TPDO2)


def test_something_of_each_pdo_is_as_long_as_there_are_pdos() -> None:
    assert [len(LazyMapping(lambda one=one: one, str)) for one in ([], [TPDO1], [TPDO1, TPDO2])] == [0, 1, 2]  # type: ignore[misc]

"""Which PDOs beside a plan are looked after: those that it could have altered, and that could be put back."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.device.change.other_pdos import cob_ids_beside
from dvtcli.device.node import Node
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan, plan_pdo
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary

TPDO1 = Pdo.parse("tpdo1")


@pytest.mark.parametrize("count", [0, 0xFE])
def test_the_cob_ids_of_the_others_are_known_also_of_a_multiplexed_pdo(count: int) -> None:
    device = booted()
    device.set_value(0x1A01, 0, bytes([count]))
    channel = DirectSdo(device)
    node = Node(DirectBus(device, channel), NODE, dictionary("generic"))
    now = node.pdos()
    moved = replace(now[TPDO1], communication=replace(now[TPDO1].communication, cob_id=CobId(0x190)))
    beside = cob_ids_beside(node, Plan(NODE, (plan_pdo(TPDO1, now[TPDO1], moved),)))
    assert beside.keys() == now.keys() - {TPDO1}
    assert all(cob_id == now[pdo].communication.cob_id for pdo, cob_id in beside.items())
    timed = replace(now[TPDO1], communication=replace(now[TPDO1].communication, event_timer=5))
    assert cob_ids_beside(node, Plan(NODE, (plan_pdo(TPDO1, now[TPDO1], timed),))) == {}

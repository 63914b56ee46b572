"""Which PDOs beside a plan are looked after: those that it could have altered, and that could be put back."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from dvtcli.device.change.untouched_pdos import untouched_cob_ids
from dvtcli.device.known_pdos import PASSING_S
from dvtcli.device.node import Node
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan, plan_pdo
from dvtcli.domain.ports import SdoTransport
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import DeviceRefused, SdoAborted
from tests.laws.bench import NODE, DirectBus, DirectSdo, FaultySdo, booted, dictionary

TPDO1 = Pdo.parse("tpdo1")


@pytest.mark.parametrize("count", [0, 0xFE])
def test_the_cob_ids_of_the_others_are_known_also_of_a_multiplexed_pdo(count: int) -> None:
    device = booted()
    device.set_value(0x1A01, 0, bytes([count]))
    channel = DirectSdo(device)
    node = Node(DirectBus(device, channel), NODE, dictionary("generic"))
    now = node.pdos()
    moved = now[TPDO1].with_parameters(cob_id=CobId(0x190))
    beside = untouched_cob_ids(node, Plan(NODE, (plan_pdo(TPDO1, now[TPDO1], moved),)))
    assert beside.keys() == now.keys() - {TPDO1}
    assert all(cob_id == now[pdo].communication.cob_id for pdo, cob_id in beside.items())
    timed = now[TPDO1].with_parameters(event_timer=5)
    assert untouched_cob_ids(node, Plan(NODE, (plan_pdo(TPDO1, now[TPDO1], timed),))) == {}


@dataclass
class Busy(DirectSdo):
    """A device that refuses its next *refusals* uploads of TPDO2's COB-ID with *code*."""

    refusals: int = 0
    code: int = 0x0800_0022

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        if (index, sub_index) == (0x1801, 1) and self.refusals:
            self.refusals -= 1
            raise SdoAborted(index, sub_index, self.code, node=NODE)
        return super().upload(index, sub_index, timeout_s=timeout_s, retries=retries)


def moves(inner: SdoTransport, index: int, sub_index: int, data: bytes) -> None:
    """The device takes a write, and moves TPDO2 with it."""
    inner.download(index, sub_index, data)
    inner.download(0x1801, 1, (0xC000_0299).to_bytes(4, "little"))


@pytest.mark.parametrize("refusals", [1, 3])
def test_a_cob_id_that_is_refused_for_a_moment_is_read_again_and_compared(refusals: int) -> None:
    device = booted()
    channel = Busy(device, refusals=refusals)
    node = Node(DirectBus(device, FaultySdo(channel, moves, 2)), NODE, dictionary("generic"))
    before = device.value(0x1801, 1)
    with pytest.raises(DeviceRefused, match="changed TPDO2 as a side effect"):
        node.configure({TPDO1: PdoRequest(cob_id=0x1A1)})
    assert device.value(0x1801, 1) == before


@pytest.mark.parametrize("code", [0x0800_0022, 0x0602_0000])
def test_one_that_is_never_told_keeps_nothing_from_being_changed(code: int) -> None:
    device = booted()
    bus = DirectBus(device, Busy(device, refusals=1000, code=code))
    Node(bus, NODE, dictionary("generic")).configure({TPDO1: PdoRequest(cob_id=0x1A1)})
    assert bus.slept_s < 3 * PASSING_S, "the rules look once, and the change"
    assert bool(bus.slept_s) is (code != 0x0602_0000)

"""The way back of a transaction: in the opposite order, and believed only once it was read."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.device.change.transaction import Transaction
from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan, Step, ValueChange, plan_pdo
from dvtcli.errors import DeviceRefused, LeftChanged
from tests.laws.bench import NODE, DirectSdo, FaultySdo, InstantClock, booted, ignore, refuse

TPDO1, TPDO2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")


def timers(sdo: DirectSdo, timer_ms: int, *pdos: Pdo) -> Plan:
    """The plan that gives each of *pdos* this event timer."""
    changes = []
    for pdo in pdos:
        now = read_pdo(sdo, pdo)
        want = replace(now, communication=replace(now.communication, event_timer=timer_ms))
        changes.append(plan_pdo(pdo, now, want))
    return Plan(NODE, tuple(changes))


def test_the_last_change_is_taken_back_first() -> None:
    """What a later change stood on must be there until that one is gone."""
    sdo = DirectSdo(booted())
    heartbeat = ValueChange(Step(0x1017, 0, sdo.upload(0x1017, 0), (1234).to_bytes(2, "little"), "heartbeat"))
    never = ValueChange(Step(0x1006, 0, bytes(4), (1000).to_bytes(4, "little"), "refused"))
    plan = Plan(NODE, (*timers(sdo, 77, TPDO1, TPDO2).changes, heartbeat, never))
    with pytest.raises(DeviceRefused) as caught:
        Transaction(FaultySdo(sdo, refuse, 4), plan, clock=InstantClock()).run()
    assert caught.value.state == "rolled_back"
    assert [index for index, _, _ in sdo.writes] == [0x1800, 0x1801, 0x1017, 0x1017, 0x1801, 0x1800]


def refuse_then_ignore(at: int) -> type[FaultySdo]:
    """A device that refuses the *at*-th write, and acknowledges every later one without taking it."""

    class Deaf(FaultySdo):
        def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
            self.fault = refuse if self.count + 1 == at else ignore
            super().download(index, sub_index, data, timeout_s=timeout_s)

    return Deaf


@pytest.mark.parametrize("kind", ["PDO", "value"])
def test_a_way_back_that_was_acknowledged_and_not_taken_is_left_changed(kind: str) -> None:
    sdo = DirectSdo(booted())
    before = sdo.upload(0x1017, 0)
    value = ValueChange(Step(0x1017, 0, before, (1234).to_bytes(2, "little"), "heartbeat"))
    pdos = timers(sdo, 77, TPDO1, TPDO2).changes
    plan = Plan(NODE, pdos if kind == "PDO" else (value, pdos[0]))
    with pytest.raises(LeftChanged) as caught:
        Transaction(refuse_then_ignore(2)(sdo, refuse, 2, True), plan, clock=InstantClock()).run()
    assert (caught.value.state, caught.value.exit_code) == ("left_changed", 7)
    if kind == "PDO":
        assert read_pdo(sdo, TPDO1).communication.event_timer == 77
        assert "TPDO1 does not read back as it was" in str(caught.value.why)
    else:
        assert sdo.upload(0x1017, 0) == value.step.after != before
        assert "1017:00 does not read back as it was" in str(caught.value.why)

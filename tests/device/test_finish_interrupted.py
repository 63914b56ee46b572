"""Finishing an interrupted change: what it puts back, what it says, and what is left of it afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from dvtcli.device.change.carry_out import carry_out
from dvtcli.device.change.journal import Journal
from dvtcli.device.change.pending import CHANGE
from dvtcli.device.change.taken_back import put_back_findings
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan, plan_pdo
from tests.device.test_carry_out import HEARTBEAT, Bench
from tests.faults.recovering import recover
from tests.laws.bench import NODE

TPDO1 = Pdo.parse("tpdo1")


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    yield made
    made.keeper.lock.release()


def interrupted(bench: Bench, plan: Plan | None = None) -> Journal:
    """A change that was made, and whose journal is still there."""
    carry_out(bench.node, plan or bench.plan(), keep_journal=True)
    journal = bench.keeper.journals.find(NODE)
    assert journal is not None
    return journal


def timed(bench: Bench, timer_ms: int) -> Plan:
    now = bench.node.pdo(TPDO1)
    want = replace(now, communication=replace(now.communication, event_timer=timer_ms))
    return Plan(NODE, (plan_pdo(TPDO1, now, want),))


def test_it_is_as_before_and_nothing_of_it_is_left(bench: Bench) -> None:
    before = bench.device.upload(*HEARTBEAT)
    journal = interrupted(bench)
    bench.node.pending.suspicions[CHANGE] = "it was interrupted"
    bench.node.pdos()
    bench.node.came_up.written = False
    plan, findings = recover(bench.node, journal)
    assert ([step.after for step in plan.steps], findings) == ([before], ())
    assert bench.device.upload(*HEARTBEAT) == before
    assert (bench.journal.exists(), bench.node.pending.suspicions) == (False, {})
    assert bench.node.last_read == {}, "what was read before counts no longer"
    assert bench.node.came_up.written
    assert bench.node.pending.boot_ups == bench.bus.boot_ups(NODE)


@pytest.mark.parametrize(
    ("found", "now", "commands"),
    [
        (NmtState.OPERATIONAL, NmtCommand.ENTER_PRE_OPERATIONAL, [NmtCommand.START]),
        (NmtState.OPERATIONAL, NmtCommand.START, []),
        (NmtState.PRE_OPERATIONAL, NmtCommand.ENTER_PRE_OPERATIONAL, []),
        (NmtState.PRE_OPERATIONAL, NmtCommand.START, []),
    ],
)
def test_it_is_started_only_where_it_was_found_operational(
    bench: Bench, found: NmtState, now: NmtCommand, commands: list[NmtCommand]
) -> None:
    journal = replace(interrupted(bench), nmt_state=int(found))
    bench.device.nmt(now)
    bench.bus.commands.clear()
    recover(bench.node, journal)
    assert bench.bus.commands == commands


def test_only_what_was_foreseen_is_said_of_what_was_put_back(bench: Bench) -> None:
    assert put_back_findings((*timed(bench, 77).changes, *bench.plan().changes)) == ()

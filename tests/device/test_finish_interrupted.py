"""Finishing an interrupted change: what it puts back, what it says, and what is left of it afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from dvtcli.device.change.apply_plan import apply_plan
from dvtcli.device.change.expected_refusals import substitute_findings
from dvtcli.device.change.journal import Journal
from dvtcli.device.habits import OFTEN_ENOUGH, Habit
from dvtcli.device.store.pending import CHANGE
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan, plan_pdo
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.device.test_apply_plan import HEARTBEAT, Bench
from tests.faults.recovering import recover
from tests.laws.bench import NODE, dictionary

TPDO1 = Pdo.parse("tpdo1")


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    yield made
    made.guard.lock.release()


def interrupted(bench: Bench, plan: Plan | None = None) -> Journal:
    """A change that was made, and whose journal is still there."""
    apply_plan(bench.node, plan or bench.plan(), keep_journal=True)
    journal = bench.guard.journals.find(NODE)
    assert journal is not None
    return journal


def timed(bench: Bench, timer_ms: int) -> Plan:
    now = bench.node.pdo(TPDO1)
    want = now.with_parameters(event_timer=timer_ms)
    return Plan(NODE, (plan_pdo(TPDO1, now, want),))


def test_it_is_as_before_and_nothing_of_it_is_left(bench: Bench) -> None:
    before = bench.device.upload(*HEARTBEAT)
    journal = interrupted(bench)
    bench.node.pending.suspicions[CHANGE] = "it was interrupted"
    bench.node.pdos()
    bench.node.boot_snapshot.written = False
    plan, findings = recover(bench.node, journal)
    assert ([step.after for step in plan.steps], findings) == ([before], ())
    assert bench.device.upload(*HEARTBEAT) == before
    assert (bench.journal.exists(), bench.node.pending.suspicions) == (False, {})
    assert bench.node.last_read == {}, "what was read before counts no longer"
    assert bench.node.boot_snapshot.written
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


@pytest.mark.parametrize("abort", [0x08000022, 0x08000000])
def test_a_device_that_is_known_to_want_pre_operational_is_brought_there_first(tmp_path: Path, abort: int) -> None:
    kind = load_family("generic")._replace(pre_operational_writes=((0x1400, 0x1BFF),), wrong_state=abort)
    device = StrictDevice(dictionary("generic"), kind, NODE)
    device.set_value(0x1018, 1, (0xABC).to_bytes(4, "little"))
    device.boot_up()
    device.take_outbox()
    bench = Bench(tmp_path, device=device)
    device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    before = device.upload(0x1800, 5)
    journal = replace(interrupted(bench, timed(bench, 77)), nmt_state=int(NmtState.OPERATIONAL))
    device.nmt(NmtCommand.START)
    for _ in range(OFTEN_ENOUGH):
        bench.node.habits.add(bench.node.identity(), Habit(None, abort))
    bench.bus.commands.clear()
    recover(bench.node, journal)
    assert device.upload(0x1800, 5) == before
    assert bench.bus.commands == [NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.START]
    bench.guard.lock.release()


def test_only_what_was_foreseen_is_said_of_what_was_put_back(bench: Bench) -> None:
    assert substitute_findings((*timed(bench, 77).changes, *bench.plan().changes)) == ()

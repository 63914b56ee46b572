"""Finishing an interrupted change: what it puts back, what it says, and what is left of it afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from dvtcli.device.change.carry_out import carry_out
from dvtcli.device.change.finish_interrupted import accepted_states, recover, refuse_other_device
from dvtcli.device.change.journal import Journal, Journals
from dvtcli.device.change.pending import CHANGE
from dvtcli.device.change.taken_back import put_back_findings
from dvtcli.device.node import Node
from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.mapping import PdoMappingEntry
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, Plan, Step, ValueChange, plan_pdo
from dvtcli.errors import LeftChanged, SafetyRefusal
from tests.device.test_carry_out import HEARTBEAT, Bench
from tests.device.test_rolling_back import odd_device
from tests.laws.bench import NODE, DirectBus
from tests.small_eds import INPUTS

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


def test_the_plan_is_from_what_is_held_now(bench: Bench) -> None:
    held = bench.node.pdo(TPDO1)
    journal = interrupted(bench, timed(bench, 77))
    bench.node.pdo(TPDO1)
    bench.device.download(0x1800, 5, b"\x09\x00")
    plan, _ = recover(bench.node, journal)
    (step,) = plan.steps
    assert (step.object, step.before) == ("1800:05", b"\x09\x00")
    assert bench.node.pdo(TPDO1) == held


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


def test_what_is_silent_is_tried_again(bench: Bench) -> None:
    journal = interrupted(bench)
    bench.fault("silent")
    with pytest.raises(LeftChanged) as caught:
        recover(bench.node, journal)
    assert caught.value.hint == f"recover tries again, from {bench.journal}"
    assert bench.journal.exists()


def test_what_is_accepted_is_shown_beside_what_was_before(bench: Bench) -> None:
    before = bench.device.upload(*HEARTBEAT).hex(" ")
    write_only = ValueChange(Step(0x2005, 1, None, b"\1", "write"))
    journal = interrupted(bench, Plan(NODE, (*timed(bench, 77).changes, *bench.plan(1000).changes)))
    journal = replace(journal, plan=replace(journal.plan, changes=(*journal.plan.changes, write_only)))
    pdo, value, unknown = accepted_states(bench.node, journal)
    assert (pdo.label, value.label, unknown.label) == ("TPDO1", "1017:00", "2005:01")
    assert value.differences == (f"is e8 03, was {before}",)
    assert value.held == "write 1017:00 0x03E8 --as u16"
    assert value.held != value.before
    assert (unknown.held, unknown.before, unknown.differences) == (
        "# 2005:01 is write-only", "# 2005:01 was not known", (),
    )  # fmt: skip
    bench.device.download(*HEARTBEAT, bytes.fromhex(before))
    assert accepted_states(bench.node, journal)[1].differences == ()


def test_another_device_is_refused_and_both_are_named(bench: Bench) -> None:
    journal = interrupted(bench)
    for identity, named in (({"vendor": 0x1A, "serial": None}, "vendor 0x1A"), ({"vendor": None}, "no identity")):
        with pytest.raises(SafetyRefusal) as caught:
            refuse_other_device(bench.node, replace(journal, identity=identity))  # type: ignore[arg-type]
        why = caught.value.why or ""
        assert why.startswith(f"it names {named}; this one is vendor 0x")


@pytest.mark.parametrize("mapped", [True, False])
def test_what_is_said_to_be_put_back_is_what_the_device_took(mapped: bool) -> None:
    """Where its mapping was changed, the odd PDO is not taken back; where only its timer was, it is as it was."""
    sdo = odd_device()
    before = read_pdo(sdo, TPDO1)
    back = PdoConfig(replace(before.communication, cob_id=before.communication.cob_id.disabled()), ())
    want = PdoConfig(before.communication, (PdoMappingEntry(INPUTS, 3, 8),)) if mapped else before
    change = replace(plan_pdo(TPDO1, before, want), back=back)
    node = Node(DirectBus(sdo.device, sdo), NODE)
    identity = node.identity()
    journals = Journals(Path("journals").resolve(), "direct")
    journals.write(Plan(NODE, (change,)), identity, None)
    for step in change.steps:
        sdo.download(step.index, step.sub_index, step.after)
    journal = journals.find(NODE)
    assert journal is not None
    plan, findings = recover(node, journal)
    assert [finding.rule for finding in findings] == (["way-back"] if mapped else [])
    (done,) = plan.changes
    assert isinstance(done, PdoChange)
    assert done.after == read_pdo(sdo, TPDO1) == (back if mapped else before)


def test_only_what_was_foreseen_is_said_of_what_was_put_back(bench: Bench) -> None:
    assert put_back_findings((*timed(bench, 77).changes, *bench.plan().changes)) == ()

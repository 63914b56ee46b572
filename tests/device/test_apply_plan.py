"""What stands around a transaction: journal, NMT state afterwards, and what an error says of both."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.change.applied import Progress
from dvtcli.device.change.apply_plan import apply_plan
from dvtcli.device.change.change_guard import ChangeGuard
from dvtcli.device.change.failed_change import BRING_BACK
from dvtcli.device.node import Node
from dvtcli.device.observe import InitialState
from dvtcli.device.store.pending import CHANGE
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan, Step, ValueChange, plan_pdo
from dvtcli.domain.profile import StepKind
from dvtcli.domain.request import PdoRequest
from dvtcli.domain.rules.finding import warning
from dvtcli.errors import DeviceRefused, DvtcliError, JournalKept, LeftChanged, NoAnswer, Restarted, SafetyRefusal
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary, profile, refuse, silence

TPDO1, TPDO2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")
HEARTBEAT = (0x1017, 0)
OPERATIONAL, PRE_OPERATIONAL = NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL


@dataclass
class Bus(DirectBus):
    """A network whose NMT commands may end badly, and on which an upload may have been repeated."""

    when_started: BaseException | None = None
    repeated: int = 0

    def send_nmt(self, command: NmtCommand, node_id: int) -> None:
        if command is NmtCommand.START and self.when_started is not None:
            raise self.when_started
        super().send_nmt(command, node_id)

    def disturbance_count(self, node_id: int) -> int:
        return self.heard_boot_ups + self.repeated


@dataclass
class Channel(DirectSdo):
    """A device that restarts, refuses or falls silent at the *at*-th write from now on; the journal is looked for."""

    what: str = ""
    at: int = 0
    bus: Bus | None = None
    journal: Path | None = None
    journals: list[bool] = field(default_factory=list)

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        if self.journal is not None:
            self.journals.append(self.journal.exists())
        self.at -= 1
        if self.what == "refuses" and self.at == 0:
            refuse(self, index, sub_index, data)
        if self.what == "silent" and self.at <= 0:
            raise silence(index, sub_index)
        super().download(index, sub_index, data, timeout_s=timeout_s)
        if self.what == "restarts" and self.at == 0:
            assert self.bus is not None
            self.device.nmt(NmtCommand.RESET_NODE)
            self.bus.heard_boot_ups += 1


class Bench:
    """A node that is OPERATIONAL, with a keeper in *folder*."""

    def __init__(self, folder: Path, family: str = "generic", device: StrictDevice | None = None) -> None:
        self.device = booted(family) if device is None else device
        self.device.nmt(NmtCommand.START)
        self.channel = Channel(self.device)
        self.bus = self.channel.bus = Bus(self.device, self.channel)
        self.guard = ChangeGuard(folder / "state", folder / "locks", "direct", NODE)
        self.journal = self.channel.journal = self.guard.journals.path(NODE)
        self.node = Node(self.bus, NODE, dictionary(family), profile(family), guard=self.guard)

    def plan(self, number: int = 1000) -> Plan:
        before = self.device.upload(*HEARTBEAT)
        return Plan(NODE, (ValueChange(Step(*HEARTBEAT, before, number.to_bytes(2, "little"), "heartbeat")),))

    def found(self, state: NmtState | None = OPERATIONAL, *, restarted: bool = False) -> InitialState:
        """How it was found; *restarted*: it restarted since then, and the change is a roll-back that goes on."""
        return InitialState(state, -1 if restarted else 0, 0, ignores_restarts=restarted)

    def fault(self, what: str, at: int = 1) -> None:
        self.channel.what, self.channel.at = what, at

    def failed(self, found: InitialState | None = None, *, keep_journal: bool = False) -> DvtcliError:
        with pytest.raises(DvtcliError) as caught:
            apply_plan(self.node, self.plan(), initial_state=found, keep_journal=keep_journal)
        return caught.value


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    yield made
    made.guard.lock.release()


def test_journal_exists_from_the_first_write_to_the_final_verify(bench: Bench) -> None:
    done: list[bool] = []
    apply_plan(bench.node, bench.plan(), done=lambda _plan, _boot_ups: done.append(bench.journal.exists()))
    assert bench.channel.journals == [True]
    assert done == [True]
    assert not bench.journal.exists()
    assert bench.node.cancellation.active, "what is complete is not stopped any more"
    assert bench.bus.commands == []


def test_journal_is_kept_if_asked(bench: Bench) -> None:
    apply_plan(bench.node, bench.plan(), keep_journal=True)
    assert bench.journal.exists()
    with pytest.raises(SafetyRefusal, match="not finished yet"):
        bench.node.begin_change()


def test_refused_write_leaves_no_journal_and_no_suspicion(bench: Bench) -> None:
    bench.fault("refuses")
    error = bench.failed()
    assert (type(error), error.state, error.details[1:]) == (DeviceRefused, "rolled_back", [])
    assert not bench.journal.exists()
    assert bench.node.pending.suspicions == {}


def test_failed_roll_back_leaves_the_journal_and_forbids_a_store(bench: Bench) -> None:
    bench.fault("silent", 2)
    step = Step(0x1006, 0, bench.device.upload(0x1006, 0), bytes.fromhex("204E0000"), "SYNC every 20 ms")
    bench.node.pdos()
    with pytest.raises(LeftChanged) as caught:
        apply_plan(bench.node, Plan(NODE, (*bench.plan().changes, ValueChange(step))))
    error = caught.value
    assert error.place == str(bench.journal)
    assert typed(error.hint) == f"{typed(BRING_BACK)}; then `recover` finishes it, with the journal {bench.journal}"
    assert bench.journal.exists()
    assert bench.node.pending.suspicions == {CHANGE: "1017:00 of node 1 could not be rolled back"}
    assert bench.node.last_seen == {}, "it is not known what it holds, so nothing is shown of it"


def test_node_that_was_operational_is_started_after_its_restart(bench: Bench) -> None:
    bench.fault("restarts")
    error = bench.failed()
    assert (error.state, error.details) == ("rolled_back", [])
    assert (bench.device.state, bench.bus.commands) == (OPERATIONAL, [NmtCommand.START])
    assert not bench.journal.exists()


@pytest.mark.parametrize(
    ("state", "details"),
    [(None, [("nmt", "node 1 restarted; its NMT state before is unknown: check it")]), (PRE_OPERATIONAL, [])],
)
def test_node_that_was_not_operational_is_not_started_after_its_restart(
    bench: Bench, state: NmtState | None, details: list[tuple[str, str]]
) -> None:
    bench.fault("restarts")
    error = bench.failed(bench.found(state))
    assert bench.bus.commands == []
    assert error.details == details


@pytest.mark.parametrize(
    ("raised", "said"),
    [
        (NoAnswer("deaf", hint="look"), "deaf: look"),
        (NoAnswer("deaf", why="no supply", hint="look"), "deaf: no supply"),
        (KeyboardInterrupt(), "stopped once more: check the NMT state of node 1"),
    ],
)
def test_failed_start_is_a_detail_of_the_refusal(bench: Bench, raised: BaseException, said: str) -> None:
    bench.fault("restarts")
    bench.bus.when_started = raised
    error = bench.failed()
    assert error.details == [("nmt", said)]
    assert not bench.journal.exists()


@pytest.mark.parametrize("keep_journal", [False, True])
def test_failed_start_after_a_verified_change_leaves_the_state_unknown(bench: Bench, keep_journal: bool) -> None:
    bench.bus.when_started = NoAnswer("deaf")
    error = bench.failed(bench.found(restarted=True), keep_journal=keep_journal)
    assert (str(error), error.state) == ("deaf", "unknown")
    assert error.state_text == "unknown: 1017:00 was written and verified before that; check the node"
    assert bench.journal.exists() is keep_journal


def test_ctrl_c_after_the_writes_leaves_the_journal(bench: Bench) -> None:
    bench.bus.when_started = KeyboardInterrupt()
    error = bench.failed(bench.found(restarted=True))
    assert error.text == "stopped before 1017:00 of node 1 was complete"
    assert (error.why, error.place, error.exit_code) == (None, str(bench.journal), 7)
    assert bench.journal.exists()
    assert CHANGE in bench.node.pending.suspicions


@pytest.mark.parametrize(
    ("state", "repeated", "commands"),
    [
        (PRE_OPERATIONAL, 1, [NmtCommand.START]),  # it restarted, and said nothing of it
        (PRE_OPERATIONAL, 0, []),
        (OPERATIONAL, 1, []),
    ],
)
def test_restart_without_boot_up_is_found_by_a_lost_answer_and_another_state(
    bench: Bench, state: NmtState, repeated: int, commands: list[NmtCommand]
) -> None:
    if state is PRE_OPERATIONAL:
        bench.device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    bench.bus.repeated = repeated
    apply_plan(bench.node, bench.plan(), initial_state=bench.found())
    assert bench.bus.commands == commands


def test_nmt_state_is_left_to_an_open_gate(tmp_path: Path) -> None:
    bench = Bench(tmp_path, "gen4")
    bench.node.configure({TPDO1: PdoRequest(event_timer=50)})
    assert bench.bus.commands == [NmtCommand.ENTER_PRE_OPERATIONAL]
    bench.bus.heard_boot_ups += 1
    apply_plan(bench.node, bench.plan(), initial_state=bench.found(restarted=True))
    assert bench.device.state is PRE_OPERATIONAL
    bench.guard.lock.release()


def test_journal_that_cannot_be_removed_is_an_error_or_a_detail_of_one(bench: Bench) -> None:
    def into_a_folder(_plan: Plan, _boot_ups: int) -> None:
        bench.journal.unlink()
        (bench.journal / "in the way").mkdir(parents=True)

    with pytest.raises(JournalKept, match="cannot be removed"):
        apply_plan(bench.node, bench.plan(), done=into_a_folder)
    (bench.journal / "in the way").rmdir()
    bench.journal.rmdir()
    bench.bus.when_started = NoAnswer("deaf")
    with pytest.raises(NoAnswer) as caught:
        apply_plan(bench.node, bench.plan(7), initial_state=bench.found(restarted=True), done=into_a_folder)
    ((label, text),) = caught.value.details
    assert label == "journal"
    assert text.startswith("the journal of node 1 cannot be removed: ")
    assert f"delete {bench.journal}" in text


def test_pdos_read_for_a_backup_are_expected_to_stay(bench: Bench) -> None:
    held = bench.node.pdos()
    bench.node.configure({TPDO1: PdoRequest(event_timer=50)})
    assert {**bench.node.expected.pdos, TPDO1: held[TPDO1]} == held
    assert bench.node.expected.pdos[TPDO1].communication.event_timer == 50


def test_other_pdos_are_read_for_a_store_if_the_program_continues() -> None:
    node = Node(DirectBus.of(booted()), NODE, dictionary("generic"))
    held = node.pdos()
    node.configure({TPDO1: PdoRequest(event_timer=50)})
    assert (node.expected.pdos.keys(), node.expected.is_complete) == (held.keys(), True)


def test_other_pdos_are_expected_to_stay_if_a_cob_id_changes(bench: Bench) -> None:
    bench.node.configure({TPDO1: PdoRequest(cob_id=0x1A1)})
    held = bench.node.pdos()
    assert bench.node.expected.pdos.keys() == held.keys()
    assert bench.node.expected.pdos[TPDO1].communication.cob_id.can_id == 0x1A1
    assert bench.node.expected.pdos[TPDO2] == held[TPDO2]


def test_values_read_before_a_change_are_forgotten(bench: Bench) -> None:
    bench.node.pdos()
    assert bench.node.last_read
    apply_plan(bench.node, bench.plan())
    assert not bench.node.last_read


def test_refusal_that_a_rule_foresaw_has_its_reason(bench: Bench) -> None:
    bench.fault("refuses")
    foreseen = (warning("rule", "0x1018:01", "another object"), warning("rule", "0x1017:00", "the manual says so"))
    with pytest.raises(DeviceRefused) as caught:
        apply_plan(bench.node, bench.plan(), findings=foreseen)
    assert caught.value.why == "the manual says so"


def test_abort_code_after_which_the_family_never_stores_is_a_suspicion(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    family = bench.node.profile
    bench.node.profile = replace(family, store=replace(family.store, never_after=(0x0800_0021,)))
    bench.fault("refuses")
    bench.failed()
    assert bench.node.pending.suspicions == {CHANGE: "the device answered 0x08000021 to a change"}
    bench.guard.lock.release()


def test_progress_has_the_number_of_each_step(bench: Bench) -> None:
    told: list[Progress] = []
    bench.node.on_step = told.append
    step = Step(0x1006, 0, bench.device.upload(0x1006, 0), bytes.fromhex("204E0000"), "SYNC every 20 ms")
    apply_plan(bench.node, Plan(NODE, (*bench.plan().changes, ValueChange(step))))
    assert [(one.node, one.done, one.total) for one in told] == [(NODE, 1, 2), (NODE, 2, 2)]
    assert told[1].step == step


@pytest.mark.parametrize(("sub_index", "hint"), [(0, "of the count"), (1, "of an entry"), (0x1F, "of an entry")])
def test_refusal_has_the_hint_of_the_family(bench: Bench, sub_index: int, hint: str) -> None:
    texts = {StepKind.COUNT: {0x0800_0021: "of the count"}, StepKind.ENTRY: {0x0800_0021: "of an entry"}}
    bench.node.profile = replace(bench.node.profile, hints=texts)
    bench.fault("refuses")
    with pytest.raises(DeviceRefused) as caught:
        apply_plan(bench.node, Plan(NODE, (ValueChange(Step(0x1A00, sub_index, None, b"\0", "write")),)))
    assert typed(caught.value.hint) == hint


def test_failure_without_an_object_is_raised_unchanged(tmp_path: Path) -> None:
    bench = Bench(tmp_path, "gen4")

    def nobody(_question: str) -> None:
        raise SafetyRefusal("nobody to ask")

    bench.node.consent = nobody
    error = bench.failed(bench.found())
    assert (error.text, error.place, error.hint) == ("nobody to ask", None, None)
    assert bench.channel.writes == []
    bench.guard.lock.release()


def restarted_before_apply(bench: Bench) -> tuple[Plan, InitialState]:
    """A plan without a write for a node that restarts before it is applied."""
    config = bench.node.pdo(TPDO1)
    found = bench.node.begin_change()
    bench.device.nmt(NmtCommand.RESET_NODE)
    bench.bus.heard_boot_ups += 1
    return Plan(NODE, (plan_pdo(TPDO1, config, config),)), found


def test_plan_without_a_write_is_verified_after_a_restart(bench: Bench) -> None:
    plan, found = restarted_before_apply(bench)
    assert len(bench.node.apply(plan, initial_state=found).plan) == 0
    assert bench.device.state is OPERATIONAL


def test_plan_without_a_write_fails_if_a_restart_changed_a_value(bench: Bench) -> None:
    plan, found = restarted_before_apply(bench)
    bench.device.download(0x1800, 5, b"\x09\x00")
    with pytest.raises(Restarted, match="TPDO1 differs from the request") as caught:
        bench.node.apply(plan, initial_state=found)
    assert (caught.value.state, caught.value.why) == ("unchanged", "0x1800:05 is 0x0009, expected 0x0000")
    assert bench.device.state is OPERATIONAL

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
from dvtcli.domain.plan import Plan, ValueChange, plan_pdo
from dvtcli.domain.profile import StepKind
from dvtcli.domain.request import PdoRequest
from dvtcli.domain.rules.finding import warning
from dvtcli.domain.step import Step
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

    def found(
        self, state: NmtState | None = OPERATIONAL, boot_ups: int = 0, disturbance_count: int = 0
    ) -> InitialState:
        """How it was found; with -1 *boot_ups* it restarted since then, and the change is a way back all the same."""
        return InitialState(state, boot_ups, disturbance_count, ignores_restarts=boot_ups < 0)

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


def test_the_journal_is_there_from_the_first_write_to_the_last_look(bench: Bench) -> None:
    done: list[bool] = []
    apply_plan(bench.node, bench.plan(), done=lambda _plan, _boot_ups: done.append(bench.journal.exists()))
    assert bench.channel.journals == [True]
    assert done == [True]
    assert not bench.journal.exists()
    assert bench.node.cancellation.active, "what is complete is not stopped any more"
    assert bench.bus.commands == []


def test_who_asks_for_it_keeps_the_journal(bench: Bench) -> None:
    apply_plan(bench.node, bench.plan(), keep_journal=True)
    assert bench.journal.exists()
    with pytest.raises(SafetyRefusal, match="not finished yet"):
        bench.node.begin_change()


def test_a_refusal_leaves_no_journal_and_no_suspicion(bench: Bench) -> None:
    bench.fault("refuses")
    error = bench.failed()
    assert (type(error), error.state, error.details[1:]) == (DeviceRefused, "rolled_back", [])
    assert not bench.journal.exists()
    assert bench.node.pending.suspicions == {}


def test_what_could_not_be_put_back_is_left_to_recover_and_never_stored(bench: Bench) -> None:
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


def test_a_node_that_restarted_is_started_again_where_it_was_found_operational(bench: Bench) -> None:
    bench.fault("restarts")
    error = bench.failed()
    assert (error.state, error.details) == ("rolled_back", [])
    assert (bench.device.state, bench.bus.commands) == (OPERATIONAL, [NmtCommand.START])
    assert not bench.journal.exists()


@pytest.mark.parametrize("state", [None, PRE_OPERATIONAL])
def test_one_that_was_found_otherwise_is_left_as_it_is(bench: Bench, state: NmtState | None) -> None:
    bench.fault("restarts")
    error = bench.failed(bench.found(state))
    assert bench.bus.commands == []
    unknown = [("nmt", "node 1 restarted; its NMT state before is unknown: check it")]
    assert error.details == ([] if state else unknown)


@pytest.mark.parametrize(
    ("raised", "said"),
    [
        (NoAnswer("deaf", hint="look"), "deaf: look"),
        (NoAnswer("deaf", why="no supply", hint="look"), "deaf: no supply"),
        (KeyboardInterrupt(), "stopped once more: check the NMT state of node 1"),
    ],
)
def test_what_cannot_be_put_right_of_its_state_is_told_beside_the_refusal(
    bench: Bench, raised: BaseException, said: str
) -> None:
    bench.fault("restarts")
    bench.bus.when_started = raised
    error = bench.failed()
    assert error.details == [("nmt", said)]
    assert not bench.journal.exists()


@pytest.mark.parametrize("keep_journal", [False, True])
def test_a_change_that_was_read_back_and_whose_node_then_cannot_be_started_is_unknown(
    bench: Bench, keep_journal: bool
) -> None:
    bench.bus.when_started = NoAnswer("deaf")
    error = bench.failed(bench.found(boot_ups=-1), keep_journal=keep_journal)
    assert (str(error), error.state) == ("deaf", "unknown")
    assert error.state_text == "unknown: 1017:00 was written and verified before that; check the node"
    assert bench.journal.exists() is keep_journal


def test_one_that_is_torn_before_its_end_is_left_to_recover(bench: Bench) -> None:
    bench.bus.when_started = KeyboardInterrupt()
    error = bench.failed(bench.found(boot_ups=-1))
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
def test_a_restart_without_a_boot_up_is_told_by_a_lost_answer_and_another_state(
    bench: Bench, state: NmtState, repeated: int, commands: list[NmtCommand]
) -> None:
    if state is PRE_OPERATIONAL:
        bench.device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    bench.bus.repeated = repeated
    apply_plan(bench.node, bench.plan(), initial_state=bench.found())
    assert bench.bus.commands == commands


def test_inside_an_open_gate_the_state_is_left_to_the_gate(tmp_path: Path) -> None:
    bench = Bench(tmp_path, "gen4")
    bench.node.configure({TPDO1: PdoRequest(event_timer=50)})
    assert bench.bus.commands == [NmtCommand.ENTER_PRE_OPERATIONAL]
    bench.bus.heard_boot_ups += 1
    apply_plan(bench.node, bench.plan(), initial_state=bench.found(boot_ups=-1))
    assert bench.device.state is PRE_OPERATIONAL
    bench.guard.lock.release()


def test_a_journal_that_stays_is_an_error_or_beside_one(bench: Bench) -> None:
    def into_a_folder(_plan: Plan, _boot_ups: int) -> None:
        bench.journal.unlink()
        (bench.journal / "in the way").mkdir(parents=True)

    with pytest.raises(JournalKept, match="cannot be removed"):
        apply_plan(bench.node, bench.plan(), done=into_a_folder)
    (bench.journal / "in the way").rmdir()
    bench.journal.rmdir()
    bench.bus.when_started = NoAnswer("deaf")
    with pytest.raises(NoAnswer) as caught:
        apply_plan(bench.node, bench.plan(7), initial_state=bench.found(boot_ups=-1), done=into_a_folder)
    ((label, text),) = caught.value.details
    assert label == "journal"
    assert text.startswith("the journal of node 1 cannot be removed: ")
    assert f"delete {bench.journal}" in text


def test_what_a_backup_read_beside_a_change_is_expected_to_stay(bench: Bench) -> None:
    held = bench.node.pdos()
    bench.node.configure({TPDO1: PdoRequest(event_timer=50)})
    assert {**bench.node.expected.pdos, TPDO1: held[TPDO1]} == held
    assert bench.node.expected.pdos[TPDO1].communication.event_timer == 50


def test_beside_a_change_whose_program_goes_on_the_others_are_read_for_a_store() -> None:
    node = Node(DirectBus.of(booted()), NODE, dictionary("generic"))
    held = node.pdos()
    node.configure({TPDO1: PdoRequest(event_timer=50)})
    assert (node.expected.pdos.keys(), node.expected.is_complete) == (held.keys(), True)


def test_beside_a_moved_pdo_the_others_are_expected_to_stay(bench: Bench) -> None:
    bench.node.configure({TPDO1: PdoRequest(cob_id=0x1A1)})
    held = bench.node.pdos()
    assert bench.node.expected.pdos.keys() == held.keys()
    assert bench.node.expected.pdos[TPDO1].communication.cob_id.can_id == 0x1A1
    assert bench.node.expected.pdos[TPDO2] == held[TPDO2]


def test_what_was_read_before_a_change_counts_no_longer(bench: Bench) -> None:
    bench.node.pdos()
    assert bench.node.last_read
    apply_plan(bench.node, bench.plan())
    assert not bench.node.last_read


def test_a_refusal_that_was_foreseen_is_told_with_the_rule_s_reason(bench: Bench) -> None:
    bench.fault("refuses")
    foreseen = (warning("rule", "0x1018:01", "another object"), warning("rule", "0x1017:00", "the manual says so"))
    with pytest.raises(DeviceRefused) as caught:
        apply_plan(bench.node, bench.plan(), findings=foreseen)
    assert caught.value.why == "the manual says so"


def test_after_what_a_family_never_stores_is_a_suspicion(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    family = bench.node.profile
    bench.node.profile = replace(family, store=replace(family.store, never_after=(0x0800_0021,)))
    bench.fault("refuses")
    bench.failed()
    assert bench.node.pending.suspicions == {CHANGE: "the device answered 0x08000021 to a change"}
    bench.guard.lock.release()


def test_each_step_that_was_taken_is_told_with_its_number(bench: Bench) -> None:
    told: list[Progress] = []
    bench.node.on_step = told.append
    step = Step(0x1006, 0, bench.device.upload(0x1006, 0), bytes.fromhex("204E0000"), "SYNC every 20 ms")
    apply_plan(bench.node, Plan(NODE, (*bench.plan().changes, ValueChange(step))))
    assert [(one.node, one.done, one.total) for one in told] == [(NODE, 1, 2), (NODE, 2, 2)]
    assert told[1].step == step


@pytest.mark.parametrize(("sub_index", "hint"), [(0, "of the count"), (1, "of an entry"), (0x1F, "of an entry")])
def test_a_refusal_is_told_with_what_the_family_knows_of_it(bench: Bench, sub_index: int, hint: str) -> None:
    texts = {StepKind.COUNT: {0x0800_0021: "of the count"}, StepKind.ENTRY: {0x0800_0021: "of an entry"}}
    bench.node.profile = replace(bench.node.profile, hints=texts)
    bench.fault("refuses")
    with pytest.raises(DeviceRefused) as caught:
        apply_plan(bench.node, Plan(NODE, (ValueChange(Step(0x1A00, sub_index, None, b"\0", "write")),)))
    assert typed(caught.value.hint) == hint


def test_a_failure_that_names_no_object_stays_as_it_is(tmp_path: Path) -> None:
    bench = Bench(tmp_path, "gen4")

    def nobody(_question: str) -> None:
        raise SafetyRefusal("nobody to ask")

    bench.node.consent = nobody
    error = bench.failed(bench.found())
    assert (error.text, error.place, error.hint) == ("nobody to ask", None, None)
    assert bench.channel.writes == []
    bench.guard.lock.release()


@pytest.mark.parametrize("held", [True, False])
def test_what_needed_no_write_is_looked_at_again_where_the_node_restarted_meanwhile(bench: Bench, held: bool) -> None:
    config = bench.node.pdo(TPDO1)
    plan = Plan(NODE, (plan_pdo(TPDO1, config, config),))
    found = bench.node.begin_change()
    bench.device.nmt(NmtCommand.RESET_NODE)
    bench.bus.heard_boot_ups += 1
    if not held:
        bench.device.download(0x1800, 5, b"\x09\x00")
    if held:
        assert len(bench.node.apply(plan, initial_state=found).plan) == 0
    else:
        with pytest.raises(Restarted, match="TPDO1 differs from the request") as caught:
            bench.node.apply(plan, initial_state=found)
        assert (caught.value.state, caught.value.why) == ("unchanged", "0x1800:05 is 0x0009, expected 0x0000")
    assert bench.device.state is OPERATIONAL

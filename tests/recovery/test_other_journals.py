"""A journal is closed with its own change only; those of other changes, and of other nodes, are dealt with too."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from dvtcli.device.node import Node
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan, plan_pdo
from dvtcli.files.eds.reader import read_eds
from dvtcli.files.user_folders import user_folder
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def waiting(node: Node, label: str, state: NmtState | None = None) -> Path:
    """The journal of a change of the event timer of PDO *label* that was interrupted; the node was in that *state*."""
    assert node.guard is not None
    pdo = Pdo.parse(label)
    now = node.pdo(pdo)
    after = now.with_parameters(event_timer=50)
    path = node.guard.journals.write(Plan(node.node_id, (plan_pdo(pdo, now, after),)), node.identity(), state)
    node.guard.lock.take()
    node.guard.lock.note(path)
    node.guard.lock.release()
    return path


def test_a_journal_that_is_named_is_not_taken_for_the_one_that_waits(tmp_path: Path) -> None:
    with Wire(device("generic")) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        node = bench.session.node()
        saved = tmp_path / "saved.json"
        shutil.move(waiting(node, "tpdo1"), saved)
        other = waiting(node, "tpdo2")
        assert bench.run(f"recover {saved}").code == 0
        assert not saved.exists()
        assert other.exists(), "that change was not rolled back"
        assert bench.run("set tpdo3 --timer 9").code == 6, "and it still waits"
        assert bench.run("recover").code == 0
        assert bench.run("set tpdo3 --timer 9").code == 0


def test_a_copy_of_the_one_that_waits_stands_for_it(tmp_path: Path) -> None:
    with Wire(device("generic")) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        copy = tmp_path / "copy.json"
        own = waiting(bench.session.node(), "tpdo1")
        shutil.copy(own, copy)
        assert bench.run(f"recover {copy}").code == 0
        assert not own.exists()
        assert bench.run("set tpdo3 --timer 9").code == 0


def test_a_journal_that_stays_does_not_leave_the_script_open_nor_keep_the_others(tmp_path: Path) -> None:
    """The journal of node 1 becomes a folder just before the script is complete: it cannot be removed."""
    folder = user_folder("state") / "journals"

    class Spoiling(StrictDevice):
        def nmt(self, command: int) -> None:
            super().nmt(command)
            if command == NmtCommand.START:
                (path,) = folder.glob("*-1.json")
                path.unlink()
                (path / "full").mkdir(parents=True)

    spoiling = Spoiling(read_eds(family_eds("generic")).dictionary, load_family("generic"), 1)
    with Wire(spoiling, device("generic", 3)) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        script = tmp_path / "both.dvt"
        script.write_text("set 1:tpdo1 --timer 40\nset 3:tpdo1 --timer 40\nnmt start all\n")
        ran = bench.run(f"run {script} --atomic")
        assert ran.code != 0
        assert "journal of node 1 cannot be removed" in ran.stderr
        assert not list(folder.glob("*-3.json"))
        assert bench.session.group.id is None, "what comes next stands alone"


class Trigger(StrictDevice):
    """A device whose first write, once it is *armed*, restarts *victim*."""

    armed = False
    victim: StrictDevice

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        super().download(index, sub_index, data)
        if self.armed:
            self.armed = False
            self.victim.nmt(NmtCommand.RESET_NODE)


@heavy
def test_an_undo_of_two_nodes_one_of_which_restarts_is_taken_back() -> None:
    trigger = Trigger(read_eds(family_eds("generic")).dictionary, load_family("generic"), 1)
    trigger.victim = device("generic", 3)
    with Wire(trigger, trigger.victim) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.script("set 1:tpdo1 --timer 40", "set 3:tpdo1 --timer 40").code == 0
        trigger.armed = True
        ran = bench.run("undo --all")
        rows = dict(line.strip().split(None, 1) for line in ran.stderr.splitlines() if line.startswith("  "))
        assert ran.code == 1, ran.stderr
        assert "node 3 restarted" in ran.stderr
        assert rows["state"].startswith("rolled back: the changes are reverted on every node"), ran.stderr
        assert rows["state"].endswith("node 3 restarted: other unstored values are lost")
        assert [one.value(0x1800, 5) for one in (trigger, trigger.victim)] == [b"\x28\0", b"\x28\0"]
        assert bench.run("undo --all").code == 0
        assert [one.value(0x1800, 5) for one in (trigger, trigger.victim)] == [b"\0\0", b"\0\0"]


class Starter(Trigger):
    """A device whose start restarts *victim* as well."""

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        StrictDevice.download(self, index, sub_index, data)

    def nmt(self, command: int) -> None:
        super().nmt(command)
        if command == NmtCommand.START:
            self.victim.nmt(NmtCommand.RESET_NODE)


def test_the_same_of_what_is_recovered() -> None:
    starter = Starter(read_eds(family_eds("generic")).dictionary, load_family("generic"), 3)
    starter.set_value(0x1017, 0, b"\x32\0")
    starter.victim = device("generic", 1)
    with Wire(starter.victim, starter) as wire, Bench((), {**wire.options, "node": None, "yes": True}) as bench:
        for node_id, state in ((1, None), (3, NmtState.OPERATIONAL)):
            waiting(bench.session.node(node_id), "tpdo1", state)
            bench.session.node(node_id).sdo.download(0x1800, 5, b"\x32\0")
        assert bench.session.wire.nmt_state(3, 10) is NmtState.PRE_OPERATIONAL
        ran = bench.run("recover")
        rows = dict(line.strip().split(None, 1) for line in ran.stderr.splitlines() if line.startswith("  "))
        assert ran.code == 1, ran.stderr
        assert "node 1 restarted after the roll-back" in ran.stderr
        assert rows["done"].startswith("node 3:"), ran.stderr

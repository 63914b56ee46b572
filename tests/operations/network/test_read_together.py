"""Nodes that are only read: one that restarts after it was read is read again, whichever answer it restarts after.

What a command answers is what it answers when it is run again at once, with nothing in between. Of all answers of a run
as many are taken by lot as `--answers` says, the first and the last with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench, Ran
from tests.harness.sample import part
from tests.operations.network.bench import device
from tests.surroundings import HOMES
from tests.virtual_time import VirtualTimeBus

NODES = (5, 9)
#: what `device` leaves in RAM only is what the file says
FILE = "nodes:\n" + "".join(
    f"  n{node_id}: {{node_id: {node_id}, profile: generic, tpdo: {{1: {{event_timer: 33}}}}}}\n" for node_id in NODES
)


class Reset(VirtualTimeBus):
    """A bus on which another master resets *node_id* right behind the answers of these numbers, 1 and up."""

    def __init__(self, devices: Sequence[StrictDevice]) -> None:
        super().__init__(devices, simulated=False)
        self.answers = 0
        self.node_id = 0
        self.after: Sequence[int] = ()

    def send_sdo(self, can_id: int, data: bytes) -> None:
        with self._lock:  # a scan asks from threads of its own
            super().send_sdo(can_id, data)
            self.answers += 1
            if self.answers in self.after:
                self._deliver(Frame(0x000, bytes([NmtCommand.RESET_NODE, self.node_id])), None)


@pytest.fixture(autouse=True)
def own_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "home").mkdir()
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "home"))


class Machine:
    """Two nodes, and a process that reads them by *line*, in which `{}` stands for the folder of files."""

    def __init__(self, folder: Path, line: str) -> None:
        self.folder = folder
        (folder / "press.yaml").write_text(FILE)
        self.line = line.format(folder)
        self.bus = Reset([device(node_id, "generic") for node_id in NODES])
        options = {"interface": "virtual", "channel": "press", "format": "json", "eds": str(family_eds("generic"))}
        self.bench = Bench((), options, self.bus)

    def run(self) -> tuple[Ran, bytes]:
        """What it ends with; and what it wrote, but for the minute in which it wrote it."""
        made = self.folder / "made"
        made.unlink(missing_ok=True)
        for suffix in (".html", ".dcf", ".jsonl"):
            made.with_suffix(suffix).unlink(missing_ok=True)
        ran = self.bench.run(self.line)
        files = [made.with_suffix(suffix) for suffix in (".html", ".dcf", ".jsonl")]
        lines = [line for one in files if one.exists() for line in one.read_bytes().splitlines()]
        return ran, b"\n".join(line for line in lines if not line.startswith(b"Modification"))


COMPARING = {
    "verify": "verify {}/press.yaml",
    "diff": "diff {}/press.yaml",
    "plan": "plan {}/press.yaml --exit-code",
}
READING = {
    "report": "report {}/made.html {}/press.yaml --for 0",
    "check": "check --live --for 0 {}/press.yaml",
    "load": "load --for 0 --at 125000",
    "load of a file": "load {}/press.yaml --for 0 --at 125000",
}


def answers(folder: Path, line: str) -> int:
    """How many answers there are without a reset."""
    machine = Machine(folder, line)
    ran, _ = machine.run()
    assert ran.code == 0, ran
    return machine.bus.answers


def sampled(found: range, config: pytest.Config, what: object) -> list[int]:
    """The first and the last of *found*, and of all as many as `--answers` says; *what* makes another lot."""
    return sorted({*found[:1], *found[-1:], *part(found, config.getoption("--answers"), config, what)})


@pytest.mark.counted
@pytest.mark.drawn(4)
@pytest.mark.parametrize("node_id", NODES)
@pytest.mark.parametrize("command", [*COMPARING, *READING])
def test_what_it_answers_is_so_when_it_ends(
    tmp_path: Path, command: str, node_id: int, pytestconfig: pytest.Config
) -> None:
    """And what it lost is a difference to what compares."""
    line = {**COMPARING, **READING}[command].replace("{}", str(tmp_path))
    count = answers(tmp_path, line)
    for after in sampled(range(1, count + 1), pytestconfig, (command, node_id)):
        machine = Machine(tmp_path, line)
        machine.bus.node_id, machine.bus.after = node_id, [after]
        disturbed, made = machine.run()
        machine.bus.after = []
        again, remade = machine.run()
        seen = (after, count, disturbed, again)
        assert (disturbed.code, disturbed.stdout, made) == (again.code, again.stdout, remade), seen
        if command in COMPARING:
            assert disturbed.code == 3, seen


@pytest.mark.counted
@pytest.mark.parametrize("line", ["backup {}/made.dcf", "compare {}/press.dcf"])
def test_a_whole_device_is_that_of_one_life(tmp_path: Path, line: str, pytestconfig: pytest.Config) -> None:
    machine = Machine(tmp_path, line)
    assert machine.bench.run("node 9").code == 0
    assert machine.bench.run(f"backup {tmp_path}/press.dcf").code == 0
    before = machine.bus.answers
    assert machine.run()[0].code == 0
    # a backup ends with four answers of the identity, which no restart changes: all else was read in one life
    last = machine.bus.answers - before - 4 * line.startswith("backup")
    for after in sampled(range(1, last + 1), pytestconfig, line):
        machine = Machine(tmp_path, line)
        machine.bench.run("node 9")
        machine.bus.node_id, machine.bus.after = 9, [machine.bus.answers + after]
        disturbed, made = machine.run()
        machine.bus.after = []
        again, remade = machine.run()
        assert (disturbed.code, disturbed.stdout, made) == (again.code, again.stdout, remade), after
        assert disturbed.code == (3 if line.startswith("compare") else 0)


@pytest.mark.parametrize("command", [*COMPARING, *READING])
def test_a_node_that_restarts_whenever_it_is_read_is_an_error(tmp_path: Path, command: str) -> None:
    machine = Machine(tmp_path, {**COMPARING, **READING}[command].replace("{}", str(tmp_path)))
    machine.bus.node_id, machine.bus.after = 9, range(1, 100_000, 5)
    ran, made = machine.run()
    assert (ran.code, made) == (5, b""), ran
    assert "restarted" in ran.stderr + ran.stdout


@pytest.mark.counted
@pytest.mark.parametrize("node_id", NODES)
def test_what_a_session_set_and_a_node_lost_is_a_difference(
    tmp_path: Path, node_id: int, pytestconfig: pytest.Config
) -> None:
    def session() -> Machine:
        machine = Machine(tmp_path, "verify")
        for one in NODES:
            machine.bench.run(f"set {one}:tpdo2 --timer 50 --yes")
        return machine

    machine = session()
    before = machine.bus.answers
    assert machine.run()[0].code == 0
    machine.bench.session.close()
    for after in sampled(range(before + 1, machine.bus.answers + 1), pytestconfig, node_id):
        machine = session()
        machine.bus.node_id, machine.bus.after = node_id, [after]
        assert machine.run()[0].code == 3, after
        machine.bench.session.close()

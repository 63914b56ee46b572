"""Nothing is written to a node that restarted since this process read it, unless a line of it ordered the restart.

Another master resets the node behind any answer from the end of one line to the first download of the next one.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench
from tests.operations.network.bench import device
from tests.operations.network.test_read_together import Reset, own_home, sampled

__all__ = ["own_home"]
NODE = 6
#: ahead of each: a change that a restart takes
FIRST = f"set {NODE}:tpdo2 --timer 40 --yes"
APPLIED = f"""
nodes:
  drive: {{node_id: {NODE}, profile: generic, tpdo: {{1: {{event_timer: 70}}}}, rpdo: {{1: {{event_timer: 70}}}}}}
  io: {{node_id: 5, profile: generic, tpdo: {{1: {{event_timer: 70}}}}}}
"""
ORDERS = [f"nmt reset-node {NODE} --yes", "nmt reset-node all --yes", f"send 000#81{NODE:02X} --yes"]
WRITING = {
    "map": f"map {NODE}:rpdo1 60FF --yes",
    "set": f"set {NODE}:tpdo1 --timer 50 --yes",
    "write": f"write {NODE}:1017:0 700 --yes",
    "disable": f"disable {NODE}:tpdo1 --yes",
    "enable": f"enable {NODE}:tpdo3 --yes",
    "clear": f"clear {NODE}:tpdo1 --yes",
    "link": f"link 5:tpdo1 {NODE}:rpdo1 --yes",
    "apply a network": "apply {}/press.yaml --yes",
    "apply a device": "apply {}/press.dcf --yes",
    "clone": "clone {}/press.dcf --yes",
    "undo": "undo --yes",
    "undo all": "undo --all --yes",
    "store": "store --yes",
    "store with a proof": "store --prove --yes",
    "restore": "restore --yes",
}


class Written(Reset):
    """A bus that counts the downloads to the node: those before and those after another master's last reset of it."""

    def __init__(self, devices: Sequence[StrictDevice]) -> None:
        super().__init__(devices)
        self.node_id = NODE
        #: by how many answers there were before each
        self.downloads: list[int] = []

    def send_sdo(self, can_id: int, data: bytes) -> None:
        if can_id == 0x600 + NODE and data[0] >> 5 in (1, 6):
            self.downloads.append(self.answers)
        super().send_sdo(can_id, data)

    def reset(self) -> None:
        """Another master resets the node now."""
        self._deliver(Frame(0x000, bytes([NmtCommand.RESET_NODE, NODE])), None)
        self.sleep(0.01)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A network file, and a DCF of a node that was set otherwise."""
    folder = tmp_path_factory.mktemp("files")
    (folder / "press.yaml").write_text(APPLIED)
    with Bench(("generic@6",)) as bench:
        assert bench.run("set tpdo1 --timer 80").code == 0
        assert bench.run(f"backup {folder}/press.dcf").code == 0
    return folder


class Machine:
    """Two nodes, and a process at work on them."""

    def __init__(self) -> None:
        self.bus = Written([device(node_id, "generic") for node_id in (5, NODE)])
        options = {"interface": "virtual", "channel": "press", "eds": str(family_eds("generic")), "format": "json"}
        self.bench = Bench((), options, self.bus)
        assert self.bench.run(f"node {NODE}").code == 0
        assert self.bench.run("pdo").code == 0

    def __enter__(self) -> Machine:
        return self

    def __exit__(self, *_: object) -> None:
        self.bench.session.close()


def positions(line: str) -> range:
    """How many answers there are from the end of the first line to the first download of *line*, from 0.

    Counted in a second process, as it were: the first change of a device reads it for its backup, too.
    """
    for _ in range(2):
        with Machine() as machine:
            assert machine.bench.run(FIRST).code == 0
            ended = machine.bus.answers
            machine.bus.downloads.clear()
            machine.bench.run(line)
            first = machine.bus.downloads[0] - ended
    return to_first_download(line, first)


def to_first_download(line: str, answers: int) -> range:
    """The numbers of *answers* up to the first download; of nodes at once its boot-up may come right behind that."""
    return range(answers + 1 - 3 * ("network" in line or ".yaml" in line))


@pytest.mark.counted
@pytest.mark.drawn(4)
@pytest.mark.parametrize("command", WRITING)
def test_at_the_prompt_the_first_line_that_writes_is_refused_once(
    command: str, files: Path, pytestconfig: pytest.Config
) -> None:
    line = WRITING[command].replace("{}", str(files))
    for after in sampled(positions(line), pytestconfig, command):
        with Machine() as machine:
            assert machine.bench.run(FIRST).code == 0
            machine.bus.downloads.clear()
            if after:
                machine.bus.after = [machine.bus.answers + after]
            else:
                machine.bus.reset()
            ran = machine.bench.run(line)
            if command.startswith("undo") and ran.code == 0:  # a restart leaves nothing to undo
                assert machine.bus.downloads == []
                continue
            assert (ran.code, machine.bus.downloads) == (6, []), (after, ran)
            # of several nodes another one may have been written first
            assert ran.documents[-1]["state"] in ("unchanged", "rolled_back" if "network" in command else "unchanged")
            if after == 0:  # later a command may have found first that the node holds something else
                assert "restarted since" in ran.documents[-1]["text"]
            assert "restarted since" not in (again := machine.bench.run(line)).stdout, again


@pytest.mark.counted
@pytest.mark.drawn(4)
@pytest.mark.parametrize("command", WRITING)
def test_in_a_script_it_is_refused_to_its_end(command: str, files: Path, pytestconfig: pytest.Config) -> None:
    line = WRITING[command].replace("{}", str(files))
    with Machine() as machine:
        machine.bench.script(FIRST)
        ended = machine.bus.answers
    for _ in range(2):  # the first change of a device reads it for its backup, too
        with Machine() as machine:
            machine.bench.script(FIRST, line)
            first = next(answers for answers in machine.bus.downloads if answers >= ended) - ended
    for after in sampled(to_first_download(command, first)[1:], pytestconfig, command):
        with Machine() as machine:
            machine.bus.after = [ended + after]
            ran = machine.bench.script(FIRST, line, line, f"set {NODE}:tpdo1 --timer 90", keep_going=True)
            late = [one for one in machine.bus.downloads if one >= ended + after]
            assert (ran.code, late) == (6, []), (after, ran)


@pytest.mark.parametrize("command", WRITING)
@pytest.mark.parametrize("order", ORDERS)
def test_a_restart_that_a_line_ordered_is_no_hindrance(command: str, order: str, files: Path) -> None:
    line = WRITING[command].replace("{}", str(files))
    with Machine() as machine:
        if not order.startswith("send"):  # of which nobody takes that what was set is lost
            assert machine.bench.run(FIRST).code == 0
        assert machine.bench.run(order).code == 0
        ran = machine.bench.script(order, FIRST, line)
        assert "restarted since" not in ran.stdout, ran
        assert ran.code == 0, ran

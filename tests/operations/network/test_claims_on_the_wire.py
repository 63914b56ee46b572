"""Commands that write and claim: all that is claimed is read after the last write and the last boot-up, on every node.

Read on the wire: behind the last download there is an upload of each claimed object. And whatever else a write alters
of what is claimed, after whichever download, no success is told, and what was there before the command is there again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import ClassVar

import pytest

from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench, Ran
from tests.harness.sample import heavy, part
from tests.operations.network.bench import device
from tests.operations.network.test_read_together import sampled
from tests.surroundings import HOMES
from tests.virtual_time import VirtualTimeBus

NODES = (5, 9)
Place = tuple[int, int, int]
#: node 5 is written, and holds its TPDO2 and its heartbeat as the file says; node 9 holds all of it
NETWORK = """
{}nodes:
  left:
    {{node_id: 5, dcf: generic, tpdo: {{1: {{event_timer: 20}}, 2: {{transmission: 255}}}}, heartbeat_producer: 100}}
  right:
    {{node_id: 9, profile: generic, tpdo: {{1: {{event_timer: 33}}}}, heartbeat_producer: 100}}
"""
STORED = NETWORK.format("defaults: {store: true}\n")
#: claimed of node 5 and not written, claimed of node 9, and what a store of node 5 would keep besides
HELD: dict[str, Place] = {
    "a parameter of a PDO": (5, 0x1801, 2),
    "an inhibit time": (5, 0x1801, 3),
    "an object": (5, 0x1017, 0),
    "a parameter that is written beside": (5, 0x1800, 2),
}
EQUAL: dict[str, Place] = {"a PDO of an equal node": (9, 0x1800, 5), "an object of an equal node": (9, 0x1017, 0)}
BESIDES: dict[str, Place] = {"a PDO that nothing names": (5, 0x1802, 2)}


class Wire(VirtualTimeBus):
    """A bus that keeps every SDO request and boot-up in order; after download number *at* it calls *then*."""

    def __init__(self, devices: Sequence[StrictDevice]) -> None:
        super().__init__(devices, simulated=False)
        self.record: list[tuple[str, Place]] = []
        self.downloads = self.answers = 0
        self.at, self.at_answer = 0, 0
        self.then: Callable[[], None] = lambda: None

    def send_sdo(self, can_id: int, data: bytes) -> None:
        kind = {1: "download", 2: "upload"}.get(data[0] >> 5)
        super().send_sdo(can_id, data)
        self.answers += 1
        if kind is not None:
            self.record.append((kind, (can_id & 0x7F, int.from_bytes(data[1:3], "little"), data[3])))
        self.downloads += kind == "download"
        if (kind == "download" and self.downloads == self.at) or self.answers == self.at_answer:
            self.then()

    def behind_the_last_download(self) -> set[Place]:
        """What was uploaded after the last download to any node."""
        last = max((at for at, (kind, _) in enumerate(self.record) if kind == "download"), default=-1)
        return {place for kind, place in self.record[last + 1 :] if kind == "upload"}


class Machine:
    """Two nodes, the files that commands take, and a process that is about to run one."""

    opened: ClassVar[list[Machine]] = []

    def __init__(self, folder: Path) -> None:
        self.close()
        self.opened.append(self)
        self.folder = folder
        self.devices = {node_id: device(node_id, "generic") for node_id in NODES}
        self.bus = Wire(list(self.devices.values()))
        options = {"interface": "virtual", "channel": "press", "eds": str(family_eds("generic")), "yes": True}
        self.bench = Bench((), options, self.bus)

    @classmethod
    def close(cls) -> None:
        """End the process before: what it holds of nodes and files is free again."""
        while cls.opened:
            cls.opened.pop().bench.session.close()

    def prepare(self, lines: Sequence[str]) -> None:
        """Run *lines* that are not looked at, and begin the record anew."""
        for line in lines:
            ran = self.bench.run(line.replace("{}", str(self.folder)))
            assert ran.code == 0, ran
        self.bus.record.clear()
        self.bus.downloads = self.bus.answers = 0

    def run(self, line: str) -> Ran:
        return self.bench.run(line.replace("{}", str(self.folder)))

    def value(self, place: Place) -> bytes:
        return self.devices[place[0]].value(*place[1:])

    def alter(self, place: Place) -> None:
        """The device changes an object of its own."""
        self.devices[place[0]].set_value(*place[1:], bytes([self.value(place)[0] ^ 5, *self.value(place)[1:]]))

    def has_stored(self) -> bool:
        """Whether a store was asked for since the record began."""
        return any(kind == "download" and place[1] == 0x1010 for kind, place in self.bus.record)

    def held(self) -> dict[Place, bytes]:
        return {place: self.value(place) for place in {**HELD, **EQUAL, **BESIDES}.values()}


@pytest.fixture(autouse=True)
def own_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    (tmp_path / "home").mkdir()
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "home"))
    yield
    Machine.close()


def written(folder: Path, name: str, text: str) -> None:
    (folder / name).write_text(text)


#: what is done before, and the command; each of them writes to node 5
FIRST = ("node 5", "export {}/press.dcf", "backup {}/press.jsonl", "set tpdo1 --timer 50")
COMMANDS: dict[str, tuple[tuple[str, ...], str]] = {
    "network file": ((), "apply {}/press.yaml"),
    "network file that stores": ((), "apply {}/stored.yaml"),
    "network file that proves": ((), "apply {}/stored.yaml --prove"),
    "saved plan": (("plan {}/press.yaml -o {}/plan.json",), "apply {}/plan.json"),
    "DCF": (FIRST, "apply {}/press.dcf"),
    "backup": (FIRST, "apply {}/press.jsonl"),
    "clone": (FIRST, "clone {}/press.jsonl"),
}
OF_BOTH = [name for name in COMMANDS if "file" in name or "plan" in name]


def machine(folder: Path, command: str) -> Machine:
    written(folder, "press.yaml", NETWORK.format(""))
    written(folder, "stored.yaml", STORED)
    made = Machine(folder)
    made.prepare(COMMANDS[command][0])
    return made


def claimed(command: str) -> list[Place]:
    return [*HELD.values(), *(EQUAL.values() if command in OF_BOTH else ())]


@heavy
@pytest.mark.parametrize("command", COMMANDS)
def test_all_that_is_claimed_is_read_behind_the_last_download(tmp_path: Path, command: str) -> None:
    press = machine(tmp_path, command)
    ran = press.run(COMMANDS[command][1])
    assert ran.code == 0, ran
    assert press.bus.downloads
    assert not set(claimed(command)) - press.bus.behind_the_last_download()


@pytest.mark.counted
@pytest.mark.drawn(4)
@pytest.mark.parametrize("command", COMMANDS)
def test_what_a_write_alters_besides_is_no_success(tmp_path: Path, command: str, pytestconfig: pytest.Config) -> None:
    """Whichever of the claims it is, and whichever download alters it: of the two as many as `--answers` says."""
    press = machine(tmp_path, command)
    assert press.run(COMMANDS[command][1]).code == 0
    cells = [(place, at) for place in claimed(command) for at in range(1, press.bus.downloads + 1)]
    for place, at in part(cells, pytestconfig.getoption("--answers"), pytestconfig, command):
        press = machine(tmp_path, command)
        before = press.held()
        press.bus.at, press.bus.then = at, lambda press=press, place=place: press.alter(place)  # type: ignore[misc]
        ran = press.run(COMMANDS[command][1])
        if ran.code == 0:
            assert press.value(place) == before[place], (place, at, ran)
        elif ran.code == 7 and "not all of them have stored it" in ran.stderr:  # what tests a store altered it
            assert "--prove" in COMMANDS[command][1], (place, at, ran)
            assert press.value(place) == before[place], (place, at, ran)
        elif not press.has_stored():
            assert ran.code == 1, (place, at, ran)
            expected = before if place[0] == 5 else {**before, place: press.value(place)}
            assert press.held() == expected, (place, at, ran)
        else:
            assert ran.code == 7, (place, at, ran)
            assert "stored" in ran.stderr, (place, at, ran)
        press.close()
        clean(tmp_path)


@heavy
@pytest.mark.parametrize("place", [(5, 0x1801, 2), (5, 0x1801, 5), (5, 0x1800, 3)])
def test_undo_of_several_nodes_reads_also_what_was_set_back_already(tmp_path: Path, place: Place) -> None:
    changes = ["set 5:tpdo2 --timer 50", "set 5:tpdo1 --timer 20", "set 9:tpdo1 --timer 20", "set 5:tpdo2 --timer 0"]
    press = Machine(tmp_path)
    press.prepare(changes)
    assert press.run("undo --all").code == 0
    assert place in press.bus.behind_the_last_download()
    downloads = press.bus.downloads
    for at in range(1, downloads + 1):
        press = Machine(tmp_path)
        press.prepare(changes)
        before = press.held()
        press.bus.at, press.bus.then = at, lambda press=press: press.alter(place)  # type: ignore[misc]
        ran = press.run("undo --all")
        assert ran.code == 1, (at, ran)
        assert press.held() == before, (at, ran)
        press.close()
        clean(tmp_path)


def clean(folder: Path) -> None:
    """No journal of one cell is in the way of the next."""
    for path in sorted(folder.glob("home/**/*"), reverse=True):
        path.unlink() if path.is_file() else path.rmdir()


@pytest.mark.counted
@pytest.mark.drawn(2)
@pytest.mark.parametrize("node_id", NODES)
@pytest.mark.parametrize("command", ["network file", "network file that stores", "saved plan"])
def test_a_node_that_restarts_after_any_answer(
    tmp_path: Path, command: str, node_id: int, pytestconfig: pytest.Config
) -> None:
    """With 0 all that the file says is there when it ends."""
    press = machine(tmp_path, command)
    assert press.run(COMMANDS[command][1]).code == 0
    answers = press.bus.answers
    for at in sampled(range(1, answers + 1), pytestconfig, (command, node_id)):
        press = machine(tmp_path, command)
        reset = Frame(0x000, bytes([NmtCommand.RESET_NODE, node_id]))
        press.bus.at_answer = at
        press.bus.then = lambda bus=press.bus, reset=reset: bus._deliver(reset, None)  # type: ignore[misc]
        ran = press.run(COMMANDS[command][1])
        press.bus.at_answer = 0
        if ran.code == 0 and at < answers:
            assert press.run("verify {}/press.yaml").code == 0, (at, answers, ran)
        press.close()
        clean(tmp_path)


@heavy
def test_the_other_pdos_of_all_nodes_are_looked_at_before_the_first_store(tmp_path: Path) -> None:
    written(
        tmp_path,
        "stored.yaml",
        STORED.replace("event_timer: 33", "event_timer: 40"),
    )
    for place in ((5, 0x1802, 2), (9, 0x1802, 2), (9, 0x1803, 3)):
        press = Machine(tmp_path)
        before = press.held(), press.value(place)
        press.bus.at, press.bus.then = 1, lambda press=press, place=place: press.alter(place)  # type: ignore[misc]
        ran = press.run("apply {}/stored.yaml")
        assert ran.code == 1, ran
        assert not press.has_stored()
        assert (press.held(), press.value(place)) == before
        press.close()
        clean(tmp_path)

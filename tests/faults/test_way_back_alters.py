"""A device that alters another PDO with a write of the way back: that is put back too, or named as left changed.

Each way back: of a single change, of an atomic script, of a network file, of a link, and undo of one node and of
several. What the devices hold is read from them, never through the tool.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench, beside
from tests.faults.matrix import Snapshot, snapshot
from tests.operations.network.bench import device

FIVE, NINE = 5, 9
#: another PDO of the node, as the device makes it: its transmission type, its event timer, its COB-ID, its mapping
ALTERED = ["1801:2:0x05", "1801:5:0x0063", "1801:1:0xC0000281", "1A01:1:0x60640020"]
REFUSED = "refuse@{}=0x06090030"
FILE = """nodes:
  a: {node_id: 5, dcf: generic, tpdo: {1: {cob_id: 0x1A1, event_timer: 70}}}
  b: {node_id: 9, dcf: generic, tpdo: {1: {cob_id: 0x1B1, event_timer: 80}}}
"""


@dataclass(frozen=True)
class Way:
    """Lines that change nodes 5 and 9, and the fault that makes them take back what they changed; None: they do."""

    lines: tuple[str, ...]
    #: the node that is refused its last write, or none
    refused: int | None = None


WAYS = {
    "map": Way(("map 5:tpdo1 6041 606C --cob-id 0x1A1 --sync 1",), FIVE),
    "clear": Way(("clear 5:tpdo1 5:rpdo1",), FIVE),
    "write": Way(("write 5:1006 20000", "map 5:tpdo1 6041 606C"), FIVE),
    "apply": Way(("apply {folder}/net.yaml",), NINE),
    "link": Way(("link 5:tpdo1 9:rpdo1",), NINE),
    "atomic": Way(("run {folder}/job.dvt --atomic",)),
    "undo": Way(("set 5:tpdo1 --timer 250", "undo")),
    "undo of all of a node": Way(("set 5:tpdo1 --timer 250", "clear 5:rpdo1", "undo --all")),
    "undo of several nodes": Way(("set 5:tpdo1 --timer 250", "set 9:tpdo1 --timer 250", "undo --all")),
    "undo of a network file": Way(("apply {folder}/net.yaml", "undo --all")),
}


@dataclass
class Ran:
    """What a way left: the exit code and what was said, the nodes before and after, and how often each was written."""

    code: int
    said: str
    before: dict[int, Snapshot]
    #: what the nodes held before the last line
    last: dict[int, Snapshot]
    after: dict[int, Snapshot]
    downloads: dict[int, int]
    #: how often each node had been written before the last line
    earlier: dict[int, int]


def ran(way: Way, folder: Path, *faults: str) -> Ran:
    folder.mkdir()
    (folder / "net.yaml").write_text(FILE)
    (folder / "job.dvt").write_text("set 5:tpdo1 --timer 250\nclear 5:rpdo1\nset 9:tpdo1 --timer 70\nmap 9:tpdo1 9:9\n")
    devices = [device(node_id, "generic") for node_id in (FIVE, NINE)]
    before = {one.node_id: snapshot(one) for one in devices}
    bus = beside(devices, *faults, *(f"{node_id}:slow-store=0" for node_id in (FIVE, NINE)))

    def downloads() -> dict[int, int]:
        return {one.device.node_id: one._faulty.downloads for one in bus.nodes if one._faulty is not None}

    code, said, earlier, last = 0, "", downloads(), before
    with Bench((), {"yes": True, "journal": str(folder / "journal"), "eds": "generic", "node": FIVE}, bus) as bench:
        for line in way.lines:
            earlier, last = downloads(), {one.node_id: snapshot(one) for one in devices}
            done = bench.run(line.format(folder=folder))
            code, said = done.code, said + done.stdout + done.stderr
    return Ran(code, said, before, last, {one.node_id: snapshot(one) for one in devices}, downloads(), earlier)


def assert_told(found: Ran) -> None:
    """It is as before all of it, or an undo came to nothing, or what is otherwise is named."""
    if found.code == 7:
        assert "TPDO2" in found.said
    else:
        assert found.after == (found.before if found.code == 0 else found.last), (found.code, found.said)


def faults_of(way: Way, folder: Path) -> list[str]:
    """What makes *way* go back."""
    if way.refused is None:
        return []
    return [f"{way.refused}:{REFUSED.format(ran(way, folder).downloads[way.refused])}"]


@pytest.mark.drawn(12)
@pytest.mark.parametrize("altered", ALTERED)
@pytest.mark.parametrize("name", WAYS)
def test_the_other_pdos_are_as_before_behind_the_way_back(name: str, altered: str, tmp_path: Path) -> None:
    """With the last write of node 5, which is of the way back, and with the one before it."""
    way = WAYS[name]
    faults = faults_of(way, tmp_path / "whole")
    back = ran(way, tmp_path / "back", *faults)
    assert_told(back)
    for number in range(2):
        at = back.downloads[FIVE] - number
        if at <= back.earlier[FIVE] or f"@{at}=" in "".join(faults):
            continue
        found = ran(way, tmp_path / f"altered-{number}", *faults, f"{FIVE}:alters@{at}={altered}")
        assert_told(found)


@pytest.mark.parametrize("name", ["undo", "undo of several nodes", "atomic", "apply"])
def test_a_device_that_alters_another_pdo_each_time_is_named(name: str, tmp_path: Path) -> None:
    """Its TPDO2 is altered whenever a PDO is enabled, which each way back does."""
    lines = {
        "undo": ("disable 5:tpdo1", "undo"),
        "undo of several nodes": ("disable 5:tpdo1", "disable 9:tpdo1", "undo --all"),
        "atomic": ("run {folder}/off.dvt --atomic",),
        "apply": ("apply {folder}/net.yaml",),
    }
    (tmp_path / "off.dvt").write_text("disable 5:tpdo1\nmap 9:tpdo1 9:9\n")
    way = Way(tuple(line.replace("{folder}/off", f"{tmp_path}/off") for line in lines[name]))
    refused = [f"9:{REFUSED.format(1)}"] if name == "apply" else []
    found = ran(way, tmp_path / "run", *refused, f"{FIVE}:enable-alters=1801:5:0x0063")
    assert_told(found)


@pytest.mark.parametrize("line", ["map 5:tpdo1 6041 606C", "set 5:tpdo1 --inhibit 5 --timer 250"])
@pytest.mark.parametrize("altered", ["", *ALTERED[:2], ALTERED[3]])
def test_the_only_change_of_a_program_claims_of_the_other_pdos_what_is_known_of_them(
    line: str, altered: str, tmp_path: Path
) -> None:
    """It reads no other PDO before it writes: what a write alters before one is refused shows in the backup alone."""
    one = device(FIVE, "generic")
    before = snapshot(one)
    bus = beside([one])
    with Bench((), {"yes": True, "journal": str(tmp_path), "eds": "generic", "node": FIVE}, bus) as bench:
        assert bench.run("set tpdo1 --timer 100").code == 0, "it makes the backup"
        assert bench.run("undo").code == 0
    assert snapshot(one) == before
    faults = [f"{FIVE}:alters@1={altered}"] if altered else []
    bus = beside([one], *faults, f"{FIVE}:{REFUSED.format(2)}")
    with Bench((), {"yes": True, "journal": str(tmp_path), "eds": "generic", "node": FIVE}, bus) as bench:
        bench.session.node(FIVE).is_last_change = lambda: True
        done = bench.run(f"{line} --json")
    error = done.documents[-1]
    assert done.code == 1, done.stderr
    assert error["state"] == ("unknown" if altered else "rolled_back")
    assert (snapshot(one) == before) == (not altered)


@pytest.mark.drawn(8)
@pytest.mark.parametrize("altered", ALTERED)
@pytest.mark.parametrize("at", [1, 2, 3])
def test_the_other_pdos_are_as_before_behind_a_recovery(at: int, altered: str, tmp_path: Path) -> None:
    """The change was left in its middle by a node that went silent; the device alters TPDO2 with a write of recover."""
    one = device(FIVE, "generic")
    before, options = snapshot(one), {"yes": True, "journal": str(tmp_path), "eds": "generic", "node": FIVE}
    with Bench((), options, beside([one], f"{FIVE}:silent@4")) as bench:
        assert bench.run("map tpdo1 6041 606C --cob-id 0x1A1 --sync 1").code == 7
    assert snapshot(one) != before
    with Bench((), options, beside([one], f"{FIVE}:alters@{at}={altered}")) as bench:
        done = bench.run("recover")
    if done.code == 7:
        assert "TPDO2" in done.stderr
    else:
        assert (done.code, snapshot(one)) == (0, before), done.stderr

"""A device that is not as its EDS says: objects that it lacks, limits that it does not check. What is learnt is."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.pdo import Direction
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family, load_family_folder
from tests.cli.commands.bench import Ran
from tests.cli.commands.bus import device
from tests.device.learn.questions import Question, put
from tests.device.learn.test_learnt_families import booted, differing
from tests.device.learn.test_put_back import values
from tests.device.learn.virtual import VirtualWire
from tests.harness.sample import heavy
from tests.small_eds import U16, communication, plain, var

EDS = family_eds("generic")
NO_OBJECT, NO_SUB = 0x06020000, 0x06090011


def learnt_of(eds: Path, family: Family) -> tuple[Ran, Family]:
    """What `learn` found out of a device of *family* with the file *eds*, and that it is as it was."""
    node = StrictDevice(read_eds(eds).dictionary, family, 1)
    wire = VirtualWire(node)
    with wire.bench({"eds": str(eds), "profile": "generic"}) as bench:
        before = values(node)
        ran = bench.run("learn --isolated --yes --save pump --json")
        assert ran.code == 0, ran
        assert values(node) == before
    return ran, load_family_folder(Path("pump"))


#: Sub-indices of parameters, a whole parameter, whole PDOs, others of the communication; with another code, too.
LACKING = [
    {(0x1803, 5): NO_SUB},
    {(0x1803, 3): NO_OBJECT, (0x1403, 2): NO_SUB},
    {(0x1803, 0): NO_OBJECT, (0x1A03, 0): NO_OBJECT},
    {(0x1600 + number, sub): NO_SUB for number in range(4) for sub in range(5, 9)},
    {(0x1011, 0): NO_OBJECT, (0x1010, 2): NO_SUB},
]


@heavy
@pytest.mark.parametrize("absent", LACKING, ids=["event timer", "two", "a PDO", "entries", "storage"])
def test_what_the_device_lacks_is_lacking(absent: dict[tuple[int, int], int]) -> None:
    listed = read_eds(EDS).dictionary
    wanted = {place: code for place, code in absent.items() if listed.entry(*place) is not None}
    assert wanted
    original = load_family("generic")._replace(absent=wanted)
    _, learnt = learnt_of(EDS, original)
    own = {place: code for place, code in learnt.absent.items() if place[1] != 4}  # which CIA 301 reserves
    assert own == wanted
    found, asked = differing(EDS, original, learnt)
    assert asked >= 60
    assert not found
    for index, sub in wanted:
        question = Question("absent", ((index, sub, 0, 1),))
        assert put(booted(EDS, original), question) == put(booted(EDS, learnt), question)


def limited(path: Path, *, narrow: bool) -> Path:
    """A file with limits: type 1..240, inhibit time 10..100, event timer 0..1000, and, if *narrow*, COB-ID 0x7FF."""
    eds = plain()
    for way, first, base in (("TPDO", 0x1800, 0x180), ("RPDO", 0x1400, 0x200)):
        for number in range(2):
            subs = communication(f"$NODEID+0x{0x80000000 + base + 0x100 * number:X}")
            subs[1] |= {"HighLimit": "0x7FF"} if narrow else {}
            subs[2] |= {"LowLimit": 1, "HighLimit": 240}
            if way == "TPDO":
                subs[3] = var("Inhibit time", U16, 10, LowLimit=10, HighLimit=100)
                subs[5] = var("Event timer", U16, 0, LowLimit=0, HighLimit=1000)
            eds.record(first + number, f"{way} communication", subs)
    path.write_text(eds.text())
    return path


@heavy
@pytest.mark.parametrize("checked", [True, False], ids=["checked", "not checked"])
def test_limits_of_the_file_are_learnt(checked: bool, tmp_path: Path) -> None:
    eds = limited(tmp_path / "limited.eds", narrow=not checked)
    names = [f"{name}-{side}-limit" for name in ("cob-id", "type", "inhibit", "event") for side in ("below", "above")]
    answers = {} if checked else {way: dict.fromkeys(names, 0) for way in Direction}
    original = load_family("generic")._replace(answers=answers)
    ran, learnt = learnt_of(eds, original)
    found, asked = differing(eds, original, learnt)
    assert asked >= 60
    assert not found
    taken = {row["name"]: row["accepted"] for row in ran.document["probes"] if "its limit" in row["name"]}
    assert {"inhibit time below its limit", "event timer above its limit"} <= set(taken)
    assert {taken["inhibit time below its limit"], taken["event timer above its limit"]} == {not checked}


@heavy
def test_the_file_that_described_a_node_describes_it_after_what_was_learnt_is_kept() -> None:
    """Its identity leads to the learnt profile now; it led to one that comes with dvtcli, and from there to the EDS."""
    wire = VirtualWire(device("gen4"))
    with wire.bench() as bench:
        before = bench.run("node --json").document["nodes"][0]
        assert before["eds"] == "gen4.eds", before
        assert bench.run("learn --yes --save kept").code == 0
    for _ in range(2):
        with wire.bench() as bench:
            after = bench.run("node --json").document["nodes"][0]
            assert (after["profile"], after["eds"]) == ("kept", "gen4.eds")

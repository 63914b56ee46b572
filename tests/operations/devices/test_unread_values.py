"""What a file says of values and nobody reads is told to whoever uses it for its values, not by `eds check` alone."""

from __future__ import annotations

from pathlib import Path

import pytest

import dvtcli
from dvtcli.operations.devices.held_device import held_by
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.operations.devices.test_apply_file import made
from tests.operations.devices.test_lost_values import COMMANDS, described
from tests.operations.devices.test_two_values import line_of
from tests.small_eds import U16, Section, var

#: what is put at the end of a file, and what is said of its first line
BEHIND = (
    ("[0x1017]\nParameterValue=700\n", "[0x1017] is not read: it belongs to no object in this file"),
    ("[1017 sub 0]\nParameterValue=700\n", "[1017 sub 0] is not read: "),
    ("[2FFEValue]\nNrOfEntries=1\n1=5\n", "[2FFEValue] is not read: "),
    ("[DeviceComisioning]\nNodeID=9\n", "[DeviceComisioning] is not read: "),
    ("[1017]\nDenotation=Beat\n", "[1017] is in line "),
)


def told(file: Path, text: str, words: str) -> None:
    """See that each command warns once of *words* in *file*, which has *text*, and so does who simulates by it."""
    file.write_text(text, "utf-8")
    with Bench(("generic@5",)) as bench:
        for command in COMMANDS:
            ran = bench.run(f"{command} {file}")
            assert (ran.code in (0, 3), ran.stderr.count(f"warning: {file}:{words}")) == (True, 1), ran
        ran = bench.run(f"compare {file} {file} --json")
        assert (ran.document["equal"], ran.stderr.count(words)) == (True, 2)
    with Bench((str(file),)) as bench:
        assert bench.run("read 1017").stderr.count(f"warning: {file}:{words}") == 1
        assert bench.run("read 1017").stderr == ""


@heavy
@pytest.mark.parametrize(("more", "words"), BEHIND)
def test_a_section_that_nobody_reads(more: str, words: str, tmp_path: Path) -> None:
    text = made(tmp_path, "generic", "dcf", "write 1017 700").read_text("utf-8") + "\n"
    told(tmp_path / "bad.dcf", text + more, f"{text.count(chr(10)) + 1}: {words}")


@heavy
def test_a_misspelt_key(tmp_path: Path) -> None:
    before, sign, after = made(tmp_path, "generic", "dcf").read_text("utf-8").partition("[1017]\n")
    text = before + sign + after.replace("ParameterValue=", "ParamValue=", 1)
    line = line_of(text, "ParamValue=0x01F4")
    told(tmp_path / "bad.dcf", text, f"{line}: ParamValue=0x01F4 is not read; did you mean ParameterValue?")


def test_values_for_no_sub_index_and_of_no_type(tmp_path: Path) -> None:
    dcf, file = described(7, 8), tmp_path / "bad.dcf"
    keys = {"ParameterName": "Table", "ObjectType": 8, "DataType": U16, "AccessType": "rw", "CompactSubObj": 2}
    dcf.more += [Section("2100", keys), Section("2100Value", {"NrOfEntries": 1, "3": "700"})]
    dcf.record(0x2200, "Record", {1: var("Part", U16, 7), 2: var("Other", 0x40, ParameterValue=9)})
    text = dcf.text().replace("[2200]\n", "[2200]\nParameterValue=6\n")
    file.write_text(text, "utf-8")
    assert [one.removeprefix(f"{file}:").partition(": ")[2] for one in held_by(str(file)).unread] == [
        "ParameterValue=6 is not read: the sub-indices of 2200 have their own",
        "ParameterValue=0x9 cannot be read: its data type is unknown",
        "3=700: the object has no such sub-index; ignored",
    ]
    file.write_text(text + "\n".join(f"[0x{index:04X}]\nParameterValue=1\n" for index in range(9)), "utf-8")
    *first, last = held_by(str(file)).unread
    assert (len(first), last) == (3, f"{file}: 9 more lines like these; a check of the file names them")


def test_an_eds_and_a_sound_file_say_nothing(tmp_path: Path) -> None:
    file = made(tmp_path, "generic", "dcf")
    assert held_by(str(file)).unread == ()
    eds = tmp_path / "odd.eds"
    eds.write_text(file.read_text("utf-8").replace("ParameterValue=", "ParamValue="), "utf-8")
    assert held_by(str(eds)).unread == ()


def test_who_simulates_by_a_file_hears_of_a_value_that_cannot_be_known(tmp_path: Path) -> None:
    file = tmp_path / "twice.dcf"
    text = described(7, 1300).text().replace("ParameterValue=0x514\n", "ParameterValue=0x514\nParameterValue=900\n")
    file.write_text(text, "utf-8")
    words = f"{file}:{line_of(text, 'ParameterValue=900')}: 2001:00 UNSIGNED32: ParameterValue=900, but ParameterValue="
    with Bench((f"{file}@5",)) as bench:
        ran = bench.run("read 2001 --json")
        assert (ran.document["value"], ran.stderr.count(words)) == (900, 1)
    with dvtcli.simulate(f"{file}@5") as bus:
        assert bus.node().read("2001").value == 900


@pytest.mark.parametrize("said", ["abc", "0x5x", "five", "12 3", "200", "-1"])
def test_a_node_id_that_is_none_is_refused(said: str, tmp_path: Path) -> None:
    file = made(tmp_path, "generic", "dcf", "write 1017 700")
    text = file.read_text("utf-8").replace("NodeID=5\n", f"NodeID={said}\n")
    file.write_text(text, "utf-8")
    with Bench(("generic@5",), {"node": (5,)}) as bench:
        for command in COMMANDS:
            ran = bench.run(f"{command} {file}")
            words = f"{file}:{line_of(text, f'NodeID={said}')}:8: error: NodeID={said} is not a node-ID (1..127)"
            assert (ran.code, words in ran.stderr) == (4, True), ran.stderr
    for none in ("", "0", "255"):
        file.write_text(text.replace(f"NodeID={said}\n", f"NodeID={none}\n"), "utf-8")
        with Bench(("generic@5",), {"node": (5,)}) as bench:
            assert bench.run(f"diff {file}").code == 3, none


@heavy
def test_a_node_id_of_an_xdc_that_is_none_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "node.xdc"
    with Bench(("generic@5",)) as bench:
        assert bench.run(f"export {file}").code == 0
        text = file.read_text("utf-8")
        assert text.count('nodeID="5"') == 1
        for said, code in (("five", 4), ("200", 4), ("255", 0), ("", 0), ("5", 0)):
            file.write_text(text.replace('nodeID="5"', f'nodeID="{said}"'), "utf-8")
            ran = bench.run(f"compare {file}")
            assert (ran.code, f"nodeID={said} is not a node-ID" in ran.stderr) == (code, code == 4), ran.stderr


def test_misspelt_keys_alone_are_told_beside_the_defaults_that_count(tmp_path: Path) -> None:
    text = made(tmp_path, "generic", "dcf").read_text("utf-8")
    file = tmp_path / "bad.dcf"
    file.write_text(text.replace("ParameterValue=", "ParamValue="), "utf-8")
    with Bench(("generic@5",)) as bench:
        for command in ("verify", "compare"):
            ran = bench.run(f"{command} {file}")
            assert "ParamValue=" in ran.stderr, command
            assert "has no values" in ran.stderr, command

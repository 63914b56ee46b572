"""A file about one device means one thing to `compare`, `diff`, `verify`, `plan` and `clone`, whatever is unsaid."""

from __future__ import annotations

import random
import re
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.cli.commands.bench import Bench
from tests.operations.devices.test_apply_file import made
from tests.operations.devices.test_export_dcf import FAMILIES
from tests.small_eds import U16, U32, Section, plain, var

pytestmark = pytest.mark.drawn(5, "said alike")

LINES = ("compare {}", "diff {}", "verify {}", "plan {} --exit-code")
#: one of each kind: of a PDO, of communication, of the mapping's count and entry
CHANGES = (
    "set tpdo1 --timer 70", "set rpdo1 --type 254", "disable rpdo1", "map tpdo1 6041 --off", "clear tpdo2",
    "write 1017 700", "write 1017 900", "map tpdo1 6041 6064 6061", "map tpdo1 6061 6041",
)  # fmt: skip
VALUE = re.compile(r"(?mi)^ParameterValue=.*\n")
BEYOND = "is beyond the node's count ({}), and the file says none (1A00:00): it is not mapped"


def thinned(text: str, keep: float, draw: random.Random) -> str:
    """The DCF *text* with about *keep* of its values, and at least the producer heartbeat time."""
    before, sign, after = text.partition("[1017]")
    kept = re.search(VALUE, after)
    assert sign
    assert kept
    head, tail = after[: kept.end()], after[kept.end() :]
    some = [VALUE.sub(lambda line: line[0] if draw.random() < keep else "", part) for part in (before, tail)]
    return some[0] + sign + head + some[1]


@pytest.mark.long
@settings(max_examples=max(2, settings().max_examples // 10))
@given(
    family=st.sampled_from(FAMILIES), of_file=st.lists(st.sampled_from(CHANGES), max_size=3),
    of_node=st.lists(st.sampled_from(CHANGES), max_size=3), keep=st.sampled_from((0.1, 0.5, 0.9)),
    draw=st.randoms(use_true_random=False),
)  # fmt: skip
def test_all_agree_whether_a_node_is_as_a_file_says(
    family: str, of_file: list[str], of_node: list[str], keep: float, draw: random.Random
) -> None:
    with TemporaryDirectory() as folder:
        file = made(Path(folder), family, "dcf", *of_file)
        file.write_text(thinned(file.read_text("utf-8"), keep, draw), "utf-8")
        with Bench((f"{family}@5",)) as bench:
            bench.run("write 6040 6")  # a drive's power stage is on, and a clone is refused then
            for line in of_node:
                assert bench.run(line).code in (0, 1), line
            ran = [bench.run(line.format(file)) for line in LINES]
            cloned = bench.run(f"clone {file} --dry-run --yes --json")
        equal = {one.code == 0 for one in ran}
        if cloned.code == 1:  # what the file says of a PDO and what the node holds make none together
            assert cloned.document["error"] == "rules", cloned.document
            equal.add(False)
        elif cloned.code != 6:  # the file of a family without a product number is for no clone
            equal.add(not (cloned.document["writes"] or cloned.document["remaining"]))
        assert len(equal) == 1, [(one.code, one.stdout, one.stderr) for one in ran]


def test_a_mapping_of_which_neither_side_says_an_entry_is_left(tmp_path: Path) -> None:
    file = made(tmp_path, "generic", "dcf", "map tpdo1 6041 6064")
    text = file.read_text("utf-8")
    before, _, after = text.partition("[1A00sub2]")
    file.write_text(f"{before}[1A00sub2]{VALUE.sub('', after, count=1)}", "utf-8")
    with Bench(("generic@5",)) as bench:
        assert bench.run("clear tpdo1").code == 0
        found = bench.run(f"diff {file} --json")
        (left,) = (one for one in found.document["nodes"][0]["left_out"] if one["object"] == "1A00:00")
        assert (found.code, left["remains"], left["why"]) == (3, True, "the file does not have all its mapping entries")
        assert bench.run("map tpdo1 6061 6064").code == 0
        assert bench.run(f"diff {file} --json").document["nodes"][0]["pdos"][0]["map"] == [
            ["6061:00/8", "6064:00/32"], ["6041:00/16", "6064:00/32"],
        ]  # fmt: skip


def test_a_file_that_says_no_setting_is_compared_with_nothing(tmp_path: Path) -> None:
    file = made(tmp_path, "generic", "dcf")
    before, sign, after = file.read_text("utf-8").partition("[1008]")
    file.write_text(VALUE.sub("", before) + sign + VALUE.sub("", after) + "", "utf-8")
    text = file.read_text("utf-8").replace("[1008]\n", "[1008]\nParameterValue=Pump\n")
    file.write_text(text, "utf-8")
    with Bench(("generic@5",)) as bench:
        assert bench.run(f"verify {file}").code == 2, "its defaults are not taken for values"
        assert bench.run(f"compare {file}").code == 2
        for line in ("plan {}", "diff {}", "apply {} --yes", "clone {} --yes"):
            ran = bench.run(line.format(file))
            assert (ran.code, "nothing compared" in ran.stderr) == (2, True), line


def without(text: str, *sections: str) -> str:
    """The DCF *text* without the values of *sections*."""
    for name in sections:
        before, sign, after = text.partition(f"[{name}]")
        assert sign
        text = f"{before}{sign}{VALUE.sub('', after, count=1)}"
    return text


def test_an_entry_beyond_the_count_of_a_node_is_not_as_wanted_where_the_file_says_no_count(tmp_path: Path) -> None:
    file, whole = made(tmp_path, "generic", "dcf", "map tpdo1 6041 6064 6061"), tmp_path / "whole.dcf"
    whole.write_text(file.read_text("utf-8"), "utf-8")
    file.write_text(without(whole.read_text("utf-8"), "1A00sub0"), "utf-8")
    with Bench(("generic@5",)) as bench:
        for line in ("map tpdo1 6041 6064 6061", "map tpdo1 6041 6064"):
            assert bench.run(line).code == 0, "0x1A00:03 has the value still, and maps nothing"
        for line in (*LINES, "clone {} --yes"):
            ran = bench.run(line.format(file))
            assert (ran.code, "1A00:03" in ran.stdout) == (3, True), (line, ran)
            if not line.startswith(("compare", "clone")):
                assert BEYOND.format(2) in ran.stdout, line
        assert bench.run(f"apply {file} --yes").code == 0
        (row,) = bench.run(f"compare {file} --json").document["differences"]
        assert (row["object"], row["before"], row["after"]) == ("1A00:03", "08 00 61 60", None)
        assert row["why"] == "not mapped: the count is 2"
        assert bench.run("map tpdo1 6061 6041").code == 0
        assert bench.run(f"apply {file} --yes").code == 0
        mapped = bench.run("pdo tpdo1 --json").document["pdos"][0]["mapping"]
        assert [one["object"] for one in mapped] == ["6061:00", "6041:00"], "no half of a mapping is written"
        assert {bench.run(line.format(file)).code for line in LINES} == {3}
        assert bench.run("map tpdo1 6041 6064 6061").code == 0
        assert [bench.run(line.format(file)).code for line in LINES] == [0] * len(LINES)
        assert bench.run("map tpdo1 6041 6064").code == 0
        assert bench.run(f"export {tmp_path / 'two.dcf'}").code == 0
        for sides, none in ((f"{file} {tmp_path / 'two.dcf'}", "after"), (f"{tmp_path / 'two.dcf'} {file}", "before")):
            ran = bench.run(f"compare {sides}")
            assert (ran.code, "not mapped: the count is 2" in ran.stdout) == (3, True), ran
            (row,) = bench.run(f"compare {sides} --json").document["differences"]
            assert (row["object"], row[none]) == ("1A00:03", None)
        assert bench.run(f"compare {whole} {file}").code == 0


def test_what_is_not_to_be_read_on_a_scan_means_the_same_to_all(tmp_path: Path) -> None:
    eds, device, file = plain(), tmp_path / "flagged.eds", tmp_path / "said.dcf"
    eds.info |= {"VendorNumber": 0x301, "ProductNumber": 0x302}
    eds.record(0x1018, "Identity", {n: var(f"Part {n}", U32, 0x300 + n, "ro") for n in (1, 2)})
    eds.variable(0x1017, var("Producer heartbeat time", U16, 500, ObjFlags=2))
    device.write_text(eds.text(), "utf-8")
    eds.variable(0x1017, var("Producer heartbeat time", U16, 500, ObjFlags=2, ParameterValue=2000))
    file.write_text(eds.text(), "utf-8")
    with Bench((f"{device}@5",)) as bench:
        for code, last in ((3, "apply {} --yes"), (0, "write 1017 500"), (3, "clone {} --yes"), (0, "compare {}")):
            assert [bench.run(line.format(file)).code for line in LINES] == [code] * len(LINES), last
            assert bench.run(last.format(file)).code == 0, last
        assert bench.run(f"backup {tmp_path / 'a.jsonl'} --json").document["left_out"] == [
            {"object": "1017:00", "why": "not to be read on a scan (ObjFlags, bit 1)"}
        ]


def test_a_list_of_the_entries_of_a_mapping_in_short_form_says_how_many(tmp_path: Path) -> None:
    eds, device, file = plain(), tmp_path / "short.eds", tmp_path / "said.dcf"
    eds.info |= {"VendorNumber": 0x301, "ProductNumber": 0x302}
    eds.record(0x1018, "Identity", {n: var(f"Part {n}", U32, 0x300 + n, "ro") for n in (1, 2)})
    del eds.objects[0x1A00]
    keys = {"ParameterName": "Map", "ObjectType": 9, "DataType": U32, "AccessType": "rw", "CompactSubObj": 4}
    eds.more.append(Section("1A00", {**keys, "DefaultValue": 0}))
    device.write_text(eds.text(), "utf-8")
    eds.more.append(Section("1A00Value", {"NrOfEntries": 2, "1": "0x60000108", "2": "0x60000208"}))
    file.write_text(eds.text(), "utf-8")
    with Bench((f"{device}@5",)) as bench:
        assert {bench.run(line.format(file)).code for line in LINES} == {3}
        assert bench.run(f"apply {file} --yes").code == 0
        mapped = bench.run("pdo tpdo1 --json").document["pdos"][0]["mapping"]
        assert [one["object"] for one in mapped] == ["6000:01", "6000:02"]
        assert {bench.run(line.format(file)).code for line in LINES} == {0}

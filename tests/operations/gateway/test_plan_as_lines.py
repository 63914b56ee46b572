"""`plan -o x.309`, and `run x.309`: the lines do what `apply` does."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dvtcli.domain.gateway_requests import Request, Write, parse_request
from dvtcli.domain.gateway_words import TYPES
from tests.cli.commands.bench import Bench
from tests.domain.gateway_requests import INDEXES, SUB_INDEXES, data_of_type
from tests.harness.sample import heavy
from tests.operations.gateway.networks import FAMILIES, everything, network_file, options

NET = """\
nodes:
  drive:
    node_id: 4
    heartbeat_producer: 700
    tpdo: {1: {enabled: true, cob_id: 0x184, transmission: 1, mapping: [6041:00/16]}}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "net.yaml"
    path.write_text(NET)
    return path


@heavy
def test_a_plan_is_written_as_lines_and_run(file: Path) -> None:
    lines = file.with_suffix(".309")
    with Bench(("generic@4",), {"yes": True}) as bench:
        planned = bench.run(f"plan {file} -o {lines}")
        assert (planned.code, f" run {lines}" in planned.stdout.partition("Next: dvtcli ")[2]) == (0, True)
        assert "# node 4 drive: vendor 0x" in lines.read_text()
        requests = [parse_request(line) for line in lines.read_text().splitlines()]
        assert [one.sequence for one in requests if one] == list(range(1, len([one for one in requests if one]) + 1))
        ran = bench.run(f"run {lines} --json")
        assert ran.code == 0, ran.stderr
        assert bench.run(f"diff {file}").code == 0
        assert bench.run(f"plan {file} -o {lines}").code == 0
        assert "nothing to do" in lines.read_text()
        assert not any(map(parse_request, lines.read_text().splitlines()))


@heavy
def test_lines_of_a_device_file_keep_what_apply_refuses(tmp_path: Path) -> None:
    held, lines = tmp_path / "held.dcf", tmp_path / "x.309"
    with Bench(("generic@4",)) as bench:
        assert bench.run("write 1017 700").code == 0
        assert bench.run(f"export {held}").code == 0
    with Bench(("generic@4",), {"yes": True}) as bench:
        assert bench.run(f"plan {held} -o {lines}").code == 0
        assert "#! require 4:power-off" in lines.read_text()
        for controlword in (6, 7, 15):
            assert bench.run(f"write 6040 {controlword}").code == 0
        for line in (f"run {lines}", f"plan {held} -o {tmp_path / 'y.309'}", "require power-off"):
            ran = bench.run(line)
            assert (ran.code, "the power stage of node 4 is on" in ran.stderr) == (6, True), line
        assert not (tmp_path / "y.309").exists()
        assert bench.run("write 6040 6").code == 0
        assert bench.run("read 1017 --json").document["value"] == 500
        assert bench.run(f"run {lines}").code == 0
        assert bench.run("read 1017 --json").document["value"] == 700
    with Bench(("gen4@4",), {"yes": True}) as bench:
        ran = bench.run(f"run {lines}")
        ran.failed(6, "is another device")
        assert bench.run("read 1017 --json").document["value"] != 700
    text = held.read_text("utf-8")
    held.write_text(re.sub(r"(?m)^RevisionNumber=.*", "RevisionNumber=0x77", text), "utf-8")
    with Bench(("generic@4",)) as bench:
        asked = bench.run(f"plan {held} -o {tmp_path / 'z.309'}")
        assert (asked.code, "is of 0x00000077" in asked.stderr, (tmp_path / "z.309").exists()) == (6, True, False)
        assert bench.run(f"plan {held} -o {tmp_path / 'z.309'} --yes").code == 0


@pytest.mark.long
@settings(max_examples=max(2, settings().max_examples // 4))  # of each, two devices from their start on
@given(st.sampled_from(FAMILIES), options())
def test_lines_that_are_run_make_the_device_that_apply_makes(family: str, config: str) -> None:
    path = network_file(Path(), config)
    with Bench((f"{family}@4",), {"yes": True}) as applied:
        code = applied.run(f"apply {path}").code
        held = everything(applied)
    with Bench((f"{family}@4",), {"yes": True}) as bench:
        assert code in (0, 1)
        assert bench.run(f"plan {path} -o lines.309").code == code
        if not code:
            ran = bench.run("run lines.309")
            assert ran.code == 0, ran.stderr + Path("lines.309").read_text()
        assert everything(bench) == held


@pytest.mark.long
@settings(max_examples=max(2, settings().max_examples // 4))  # of each, two devices from their start on
@given(st.sampled_from(FAMILIES), options())
def test_what_a_session_saves_as_lines_makes_the_device_that_it_made(family: str, config: str) -> None:
    path = network_file(Path(), config)
    with Bench((f"{family}@4",), {"yes": True}) as done:
        changed = done.run(f"apply {path}").code == 0
        done.run("write 1017 650")
        done.run("write 1017 651")
        saved = done.run("save lines.309")
        assert saved.code == 0, saved.stderr
        held = everything(done)
    with Bench((f"{family}@4",), {"yes": True}) as bench:
        ran = bench.run("run lines.309")
        assert (ran.code, everything(bench)) == (0, held), (changed, ran.stderr, Path("lines.309").read_text())


@pytest.mark.parametrize(
    ("before", "line", "why"),
    [
        ("", "save x.309", "changed nothing"),
        ("set tpdo1 --timer 20\nset tpdo1 --timer 0", "save x.309", "reverted"),
        ("set tpdo1 --timer 20\nrestore", "save x.309", "no gateway line does what `restore`"),
        ("set tpdo1 --timer 20", "save x.309 --all", "leave out --history and --all"),
    ],
)
def test_what_lines_cannot_say_is_not_saved(before: str, line: str, why: str) -> None:
    with Bench(("generic@4",), {"yes": True}) as bench:
        for one in filter(None, before.split("\n")):
            assert bench.run(one).code == 0
        ran = bench.run(line)
        assert (ran.code, why in ran.stderr, Path("x.309").exists()) == (2, True, False), ran


def test_a_store_is_saved_with_the_lines() -> None:
    with Bench(("generic@4",), {"yes": True}) as bench:
        for one in ("set tpdo1 --timer 20", "store", "save x.309"):
            assert bench.run(one).code == 0
    assert 'w 0x1010 1 vs "save"' in Path("x.309").read_text()


def test_a_store_alone_is_saved_as_a_line() -> None:
    with Bench(("generic@4",), {"yes": True}) as bench:
        for one in ("store", "save x.309"):
            assert bench.run(one).code == 0
    assert 'w 0x1010 1 vs "save"' in Path("x.309").read_text()


def test_each_store_is_saved_with_the_lines() -> None:
    with Bench(("generic@4",), {"yes": True}) as bench:
        for one in ("set tpdo1 --timer 20", "store communication", "store application", "save x.309", "save x.dvt"):
            assert bench.run(one).code == 0
    sent = [one.command for one in map(parse_request, Path("x.309").read_text().splitlines()) if one]
    stores = [one.sub_index for one in sent if isinstance(one, Write) and one.index == 0x1010]
    assert stores == [2, 3]
    assert Path("x.dvt").read_text().endswith("store 2\nstore 3\n")


@pytest.mark.parametrize("file", ["x.309", "x.dvt", "x.tcl"])
def test_a_store_that_is_not_saved_is_named(file: str) -> None:
    """What was changed behind it was not stored, so it cannot stand behind all changes."""
    with Bench(("generic@4",), {"yes": True}) as bench:
        for one in ("write 1017 700", "store communication", "write 1017 900", "store application"):
            assert bench.run(one).code == 0
        ran = bench.run(f"save {file}")
        assert (ran.code, "`store 2` of node 4 is left out" in ran.stderr) == (0, True), ran.stderr
        assert bench.run("store communication").code == 0
        assert "left out" not in bench.run(f"save {file}").stderr


def test_a_saved_plan_is_shown_and_written_as_lines(file: Path) -> None:
    with Bench(("generic@4",), {"yes": True}) as bench:
        assert bench.run(f"plan {file} -o plan.json").code == 0
        assert bench.run(f"plan {file} -o a.309").code == 0
        shown = bench.run("plan plan.json -o b.309 --json")
        assert (shown.code, shown.document["writes"]) == (0, bench.run(f"plan {file} --json").document["writes"])
        assert bench.run("set tpdo1 --timer 33").code == 0
        assert bench.run("plan plan.json").code == 6
    said = [Path(name).read_text().partition("\n")[2] for name in ("a.309", "b.309")]
    assert said[0] == said[1]


def test_what_a_file_of_lines_may_hold(tmp_path: Path) -> None:
    path = tmp_path / "x.309"
    path.write_text(
        "# comment\n[1] set node 4\n[2] preop\n[3] set sdo_timeout 700\r\n[4] w 0x1017 0 u16 1234\n[5] r 0x1017 0 u16\n"
        "[6] 1 4 r 0x1018 1\n[7] w 0x1010 1 vs save\n[8] set network 1\n4 r 0x1008 0 vs\n[9] 0 preop\n"
    )
    with Bench(("generic@4",), {"yes": True}) as bench:
        ran = bench.run(f"run {path} --json")
        assert ran.code == 0, ran.stderr
        values = [one["value"] for one in ran.documents if one["schema"] == "dvtcli.value/1"]
        assert values[0] == 1234


@pytest.mark.parametrize("slip", ["#!require", "#! requires", "#! Require", "  #! requier", "#!\trequire", "#!"])
def test_a_check_with_a_slip_of_the_pen_is_no_comment(slip: str) -> None:
    Path("x.309").write_text(f"#!/usr/bin/env client\n#\n{slip} 4:identity vendor=0x99\n4 w 0x1017 0 u16 5\n")
    with Bench(("generic@4",), {"yes": True}) as bench:
        ran = bench.run("run x.309")
        assert (ran.code, "x.309:3: " in ran.stderr, bench.session.record.lines) == (2, True, [])


@pytest.mark.parametrize("space", ["", " ", "\t"])
def test_a_check_may_be_indented(space: str) -> None:
    Path("x.309").write_text(f"{space}#! require 4:identity vendor=0x99\n4 w 0x1017 0 u16 5\n")
    with Bench(("generic@4",), {"yes": True}) as bench:
        ran = bench.run("run x.309")
        assert (ran.code, "is another device" in ran.stderr, bench.session.record.lines) == (6, True, [])


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("[1] 4 w 0x1017 0 u16", "x.309:2: data type and value are missing"),
        ("[1] lss_store", "`lss_store` is for a gateway, not for a file of lines"),
        ("[1] r p 1", "a PDO of the gateway itself is for a gateway"),
        ("[1] 2 4 r 0x1018 1", "unknown net 2"),
        ("[1] 200 start", "1…127"),
    ],
)
def test_what_it_may_not_is_said_before_anything_is_done(line: str, why: str) -> None:
    Path("x.309").write_text(f"[0] 4 w 0x1017 0 u16 1234\n{line}\n")
    with Bench(("generic@4",), {"yes": True}) as bench:
        ran = bench.run("run x.309")
        assert ran.code == 2
        assert why in ran.stderr
        assert not bench.session.record.lines


@given(
    INDEXES, SUB_INDEXES, st.sampled_from(sorted(TYPES)).flatmap(lambda one: st.tuples(st.just(one), data_of_type(one)))
)
def test_a_value_comes_through_a_line_as_it_is(index: int, sub_index: int, typed: tuple[str, bytes]) -> None:
    from dvtcli.cli.scripts.gateway_script import GatewayScript
    from dvtcli.domain.datatypes import BY_SHORT_NAME
    from dvtcli.domain.gateway_requests import format_request

    name, data = typed
    line = format_request(Request(1, 1, 4, Write(index, sub_index, name, data)))
    word, place, value, option, short = GatewayScript().words(line, "x:1")
    assert (word, place, option) == ("write", f"4:{index:04X}:{sub_index:02X}", "--as")
    said = value.removeprefix("@") if value.startswith("@@") else value
    assert BY_SHORT_NAME[short].parse(said) == (data.rstrip(b"\0") if name == "vs" else data)

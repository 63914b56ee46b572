"""`--trust-stamp` in words: who was not read is named in every format, and in a saved plan."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.process import ROOT

FILE = ROOT / "examples" / "stamped.yaml"


@pytest.fixture
def bench() -> Iterator[Bench]:
    """Both nodes as the file says, then one of them changed by hand."""
    with Bench(("generic@5", "generic@9"), {"yes": True}) as made:
        assert made.run(f"apply {FILE}").code == 0
        assert made.run("set 9:tpdo1 --inhibit 20").code == 0
        yield made


@heavy
def test_text_names_who_was_not_read(bench: Bench) -> None:
    said = bench.run(f"plan {FILE} --trust-stamp").stdout
    assert said.count("not read: its stamp (0x1020) is that of the file") == 1
    assert bench.run("undo").code == bench.run("node 9").code == bench.run("store").code == 0
    said = bench.run(f"plan {FILE} --trust-stamp").stdout
    assert said.count("not read: its stamp (0x1020) is that of the file") == 1
    assert bench.run(f"apply {FILE}").code == 0
    said = bench.run(f"diff {FILE} --trust-stamp").stdout
    assert "No difference: every node, by its stamp (0x1020), has the values of the file." in said
    assert "Every node, by its stamp (0x1020), has" in bench.run(f"apply {FILE} --trust-stamp").stdout


@heavy
def test_an_atomic_script_that_is_taken_back_leaves_the_stamp_as_it_was(bench: Bench, tmp_path: Path) -> None:
    script = tmp_path / "lines.dvt"
    script.write_text("node 5\nset tpdo1 --timer 70\nwrite 1018:1 0\n")
    before = bench.run("read 5:1020:1").stdout, bench.run("read 5:1020:2").stdout
    assert bench.run(f"run --atomic {script}").code != 0
    assert (bench.run("read 5:1020:1").stdout, bench.run("read 5:1020:2").stdout) == before
    script.write_text("node 5\nset tpdo1 --timer 70\n")
    assert bench.run(f"run --atomic {script}").code == 0
    assert bench.run("read 5:1020:1").stdout != before[0]


@heavy
def test_documents_say_it(bench: Bench) -> None:
    for line in ("plan {} --json", "plan {} --trust-stamp --json", "apply {} --trust-stamp --json"):
        document = bench.run(line.format(FILE)).document
        trusts = "--trust" in line
        assert [node["read"] for node in document["nodes"]] == [not trusts, True]
        assert [node["unchanged"] for node in document["nodes"]] == [0 if trusts else 3, 0]


@heavy
def test_formats_for_ci_say_it(bench: Bench) -> None:
    github = bench.run(f"diff {FILE} --trust-stamp --format github").stdout
    assert "::notice " in github
    assert "stamp of node 5: not read: its stamp (0x1020) is that of the file" in github
    junit = ET.fromstring(bench.run(f"diff {FILE} --trust-stamp --format junit").stdout)  # noqa: S314
    suite = next(one for one in junit.iter("testsuite") if one.get("name") == "node 5")
    assert (suite.get("tests"), suite.get("skipped"), suite.get("failures")) == ("1", "1", "0")
    assert [one.get("message") for one in suite.iter("skipped")] == ["not read: its stamp (0x1020) is that of the file"]


@heavy
def test_a_saved_plan_keeps_it(bench: Bench, tmp_path: Path) -> None:
    saved = tmp_path / "plan.json"
    assert bench.run(f"plan {FILE} --trust-stamp -o {saved}").code == 0
    assert [node["read"] for node in json.loads(saved.read_text())["nodes"]] == [False, True]
    assert bench.run(f"apply {saved} --trust-stamp").code == 2
    applied = bench.run(f"apply {saved} --json").document
    assert [node["read"] for node in applied["nodes"]] == [False, True]
    assert bench.run(f"diff {FILE}").code == 0


def test_a_stamp_that_is_not_stored_is_an_error(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "one.yaml"
    for store in ("", ", store: false", ", store: communication"):
        path.write_text(f"one: {{node_id: 5, stamp: true{store}}}\n")
        ran = bench.run(f"check {path} --json")
        assert ran.code == 4
        (complaint,) = ran.documents[-1]["complaints"]
        assert (complaint["line"], complaint["column"]) == (1, 19)
    path.write_text("one: {node_id: 5, stamp: true, store: 1}\n")
    assert bench.run(f"check {path}").code == 0


def test_what_is_not_read_is_not_proved_either() -> None:
    with Bench(("generic@5", "generic@9"), {"yes": True}) as bench:
        ran = bench.run(f"apply {FILE} --trust-stamp --prove")
        ran.failed(2, "--trust-stamp and --prove: give only one of them")

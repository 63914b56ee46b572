"""`plan`, `diff` and `verify` in the formats of CI, and failures in them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from tests.commands.bench import Bench

FILE = """nodes:
  drive:
    node_id: 1
    tpdo:
      1: {event_timer: 20}
      2: {enabled: true}
  motor:
    node_id: 5
    heartbeat_producer: 700
"""


@pytest.fixture
def bench() -> Iterator[Bench]:
    with Bench(("gen4@1", "tmcm@5"), {"yes": True}) as made:
        yield made


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "net.yaml"
    path.write_text(FILE)
    return path


def counted(text: str) -> tuple[int, int, int]:
    suites = ET.fromstring(text)  # noqa: S314 - our own
    assert len(suites.findall(".//testcase")) == int(suites.attrib["tests"])
    for kind, tag in (("failures", "failure"), ("errors", "error")):
        assert len(suites.findall(f".//{tag}")) == int(suites.attrib[kind])
    tests, failures, errors = (int(suites.attrib[name]) for name in ("tests", "failures", "errors"))
    return tests, failures, errors


def test_github_gets_a_command_for_each_difference(bench: Bench, file: Path) -> None:
    place = f"file={file},line=5,title=node 1::TPDO1 of node 1: event_timer: 0 ms -> 20 ms"
    assert f"::notice {place}" in bench.run(f"plan {file} --format github").stdout.splitlines()
    ran = bench.run(f"diff {file} --format github")
    assert (ran.code, ran.stdout.splitlines()[0]) == (3, f"::error {place}")
    ran = bench.run(f"verify {file} --format github")
    assert (ran.code, ran.stdout.count("::error ")) == (3, 2)
    assert bench.run(f"apply {file}").code == 0
    for word in ("diff", "verify"):
        ran = bench.run(f"{word} {file} --format github")
        assert (ran.code, ran.stdout.count("::error ")) == (0, 0)


def test_junit_gets_a_case_for_each_pdo_and_object(bench: Bench, file: Path) -> None:
    assert counted(bench.run(f"plan {file} --format junit").stdout) == (3, 0, 0)
    for word in ("diff", "verify"):
        assert counted(bench.run(f"{word} {file} --format junit").stdout) == (3, 2, 0)
    assert bench.run(f"apply {file}").code == 0
    for word in ("diff", "verify"):
        assert counted(bench.run(f"{word} {file} --format junit").stdout) == (3, 0, 0)
    assert counted(bench.run("verify --format junit").stdout)[1:] == (0, 0)


def test_a_failure_leaves_no_report_empty(bench: Bench, file: Path) -> None:
    file.write_text(FILE.replace("event_timer", "event_tmer").replace("700", "-1"))
    lines = bench.run(f"plan {file} --format github").stdout.splitlines()
    assert [line.partition("title")[0] for line in lines] == [
        f"::error file={file},line=5,col=11,", f"::error file={file},line=9,col=25,",
    ]  # fmt: skip
    ran = bench.run(f"plan {file} --format junit")
    assert (ran.code, counted(ran.stdout)) == (4, (1, 0, 1))
    assert "2 errors. Nothing was sent." in ran.stderr
    file.write_text("a: {node_id: 1, identity: {vendor: 9}}\nb: {node_id: 9}\n")
    ran = bench.run(f"verify {file} --format github")
    assert (ran.code, ran.stdout.count("::error title=")) == (6, 2)
    assert bench.run(f"apply {file} --format github").code == 2

"""`check`: what the rules find in files and on a bus, in every format, with its exit code."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.process import ROOT

LINE, FAULTY = ROOT / "examples" / "line.yaml", ROOT / "examples" / "faulty.yaml"


@pytest.fixture
def nothing() -> Iterator[Bench]:
    """A session without any bus."""
    with Bench(()) as made:
        yield made


def rules(ran_document: dict[str, list[dict[str, list[dict[str, str]]]]]) -> list[str]:
    """The rules that found something, of all files."""
    return [found["rule"] for file in ran_document["files"] for found in file["findings"]]


@pytest.mark.parametrize(("name", "options"), [("line.yaml", "--at 500000"), ("bus.yml", "")])
def test_of_clean_examples_nothing_is_said(nothing: Bench, name: str, options: str) -> None:
    ran = nothing.run(f"check {ROOT / 'examples' / name} {options} --strict --json")
    assert (ran.code, rules(ran.document)) == (0, [])


def test_a_finding_has_the_line_of_its_pdo(nothing: Bench) -> None:
    ran = nothing.run(f"check {FAULTY} --json")
    (file,) = ran.document["files"]
    assert (ran.code, file["count"]) == (4, {"error": 1, "warning": 2, "note": 1})
    first = next(one for one in file["findings"] if one["rule"] == "frame-too-short")
    assert (first["line"], first["node"], first["pdo"], first["severity"]) == (8, 1, "rpdo1", "error")
    text = nothing.run(f"check {FAULTY}").stdout.splitlines()
    assert text[0].startswith(f"{FAULTY}:8:7: error: node 1 RPDO1: it maps 56 bits")
    assert text[-1] == f"{FAULTY}: 2 nodes, 8 PDOs; 1 error, 2 warnings, 1 note"


@heavy
def test_rules_are_chosen_by_name(nothing: Bench) -> None:
    assert rules(nothing.run(f"check {FAULTY} --rule unwatched-link --json").document) == ["unwatched-link"]
    left = nothing.run(f"check {FAULTY} --without frame-too-short --json")
    assert (left.code, "frame-too-short" in rules(left.document)) == (0, False)
    assert nothing.run(f"check {FAULTY} --without frame-too-short --strict").code == 4
    wrong = nothing.run(f"check {FAULTY} --rule unwached-link")
    wrong.failed(2, "did you mean unwatched-link?")


@heavy
def test_formats_for_ci(nothing: Bench) -> None:
    github = nothing.run(f"check {FAULTY} {LINE} --format github")
    assert github.code == 4
    assert f"::error file={FAULTY},line=8,col=7,endColumn=7,title=frame-too-short::node 1 RPDO1" in github.stdout
    suites = ET.fromstring(nothing.run(f"check {FAULTY} {LINE} --format junit").stdout)  # noqa: S314 - our own
    assert (suites.attrib["failures"], len(suites)) == ("1", 2)
    assert suites[0].attrib["name"] == f"check {FAULTY}"
    sarif = json.loads(nothing.run(f"check {FAULTY} --format sarif").stdout)
    (run,) = sarif["runs"]
    assert {one["ruleId"] for one in run["results"]} == {
        "frame-too-short", "unwatched-link", "unbounded-event-pdo", "unknown-bit-rate",
    }  # fmt: skip


def test_what_cannot_be_read_is_a_finding_in_formats_for_ci(nothing: Bench) -> None:
    Path("wrong.yaml").write_text("a:\n  node_id: 1\n  profile: gen4\n  tpdo: {1: {mapping: [nonsense]}}\n")
    assert nothing.run("check wrong.yaml").code == 4
    ran = nothing.run("check wrong.yaml --format github")
    assert ran.code == 4
    assert (
        "::error file=wrong.yaml,line=4,col=24,endColumn=31,title=network-file::no object is named 'nonsense'"
        in ran.stdout
    )
    Path("broken.yaml").write_text("a: [")
    assert nothing.run("check broken.yaml --format junit").code == 4


def test_what_cannot_be_made_is_found_and_the_rest_is_looked_at(nothing: Bench) -> None:
    text = FAULTY.read_text() + "links:\n  - {from: 'joystick:tpdo1', to: ['drive:rpdo2']}\n"
    Path("linked.yaml").write_text(text)
    ran = nothing.run("check linked.yaml --json")
    assert ran.code == 4
    assert {"link-length", "unbounded-event-pdo"} <= set(rules(ran.document))
    (link,) = [one for one in ran.document["files"][0]["findings"] if one["rule"] == "link-length"]
    assert (link["line"], link["column"]) == (9, 7), "the RPDO stands there"


@pytest.mark.parametrize("name", ["no_such_object", "digital_inputs"])
def test_a_mapping_that_cannot_be_read_has_no_findings_about_the_rest_of_its_pdo(nothing: Bench, name: str) -> None:
    """Its neighbours keep theirs."""
    pdo = "{{enabled: true, mapping: [{}]}}"
    other, unread = pdo.format("statusword"), pdo.format(name)
    Path("named.yaml").write_text(f"nodes: {{a: {{node_id: 5, dcf: generic, tpdo: {{1: {unread}, 2: {other}}}}}}}\n")
    ran = nothing.run("check named.yaml --json")
    (file,) = ran.document["files"]
    assert ran.code == 4
    found = {(found["rule"], found["pdo"]) for found in file["findings"]}
    assert ("network-file", None) in found
    assert ("unbounded-event-pdo", "tpdo2") in found
    assert "tpdo1" not in {pdo for _, pdo in found}


def test_a_file_whose_identity_its_nodes_do_not_have(nothing: Bench) -> None:
    text = LINE.read_text().replace("profile: gen4", "profile: gen4\n    identity: {vendor: 0x1E, product: 1}")
    Path("other.yaml").write_text(text)
    ran = nothing.run("check other.yaml --at 500000 --json")
    assert (ran.code, rules(ran.document)) == (4, ["identity"])


@heavy
def test_nodes_on_a_bus() -> None:
    with Bench(("gen4@1", "generic@5"), {"yes": True}) as bench:
        ran = bench.run("check --json")
        (bus,) = ran.document["files"]
        assert (ran.code, bus["file"], bus["bus"], bus["count"]["error"]) == (0, None, "sim", 0)
        assert "unbounded-event-pdo" in rules(ran.document)
        assert bench.run("check --strict").code == 3
        assert bench.run("set 5:tpdo1 --cob-id 0x2A0").code == 0
        for line in ("node 1", "write 1016:1 0x00050064"):
            assert bench.run(line).code == 0
        ran = bench.run(f"check {LINE} --live --json")
        assert (ran.code, [one["bus"] for one in ran.document["files"]]) == (3, [None, "sim", "sim"])
        assert "heartbeat-too-short" in rules(ran.document)


def test_the_bit_rate_decides_what_fits(nothing: Bench) -> None:
    fits = nothing.run(f"check {LINE} --at 125000")
    late = nothing.run(f"check {LINE} --at 50000 --json")
    assert fits.code == 0
    assert (late.code, set(rules(late.document))) == (4, {"too-late"})

"""A network file that sets what a device does not have: everything else is compared, and nothing is written."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

import dvtcli
from dvtcli.errors import RuleError
from tests.cli.commands.bench import Bench

FILE = """nodes:
  first:
    node_id: 1
    tpdo:
      1: {event_timer: 50}
      70: {cob_id: 0x1A5, event_timer: 20}
  second:
    node_id: 2
    tpdo:
      1: {event_timer: 70}
  third:
    node_id: 3
    rpdo:
      99: {enabled: true}
links:
  - {from: first:tpdo70, to: second:rpdo1}
  - {from: first:tpdo71, to: second:rpdo2}
"""
NODES = ("generic@1", "generic@2", "generic@3")
LACKED = [(1, "tpdo70"), (1, "tpdo71"), (3, "rpdo99")]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "n.yaml").write_text(FILE)
    return tmp_path / "n.yaml"


@pytest.mark.parametrize("word", ["diff", "plan", "plan --exit-code", "verify"])
def test_every_node_is_compared_and_what_is_lacked_is_said_last(word: str, file: Path) -> None:
    with Bench(NODES) as bench:
        ran = bench.run(f"{word} {file}")
        assert ran.code == 1
        assert "TPDO1" in ran.stdout
        assert "50" in ran.stdout
        assert "70" in ran.stdout
        assert "No difference" not in ran.stdout
        assert "Next: " not in ran.stdout
        assert f"error: {file}:6:7: node 1 has no TPDO70: it has tpdo1…tpdo4" in ran.stderr
        assert "node 1 has no TPDO71" in ran.stderr
        assert "node 3 has no RPDO99" in ran.stderr
        document = bench.run(f"{word} {file} --json").document
        assert [(one["node"], one["pdo"]) for one in document["lacking"]] == LACKED
    with Bench(NODES) as bench:
        planned = bench.run(f"plan {file} --json").document
        assert {one["node"]: len(one["pdos"]) for one in planned["nodes"]} == {1: 1, 2: 1, 3: 0}


def test_nothing_is_written_and_nothing_saved(file: Path, tmp_path: Path) -> None:
    with Bench(NODES) as bench:
        for line in (f"apply {file} --yes", f"apply {file} --yes --force", f"plan {file} -o {tmp_path / 'p.json'}"):
            ran = bench.run(line)
            assert (ran.code, ran.stdout) == (1, ""), line
            assert "n.yaml:6:7: node 1 has no TPDO70" in ran.stderr
        assert not (tmp_path / "p.json").exists()
        for node in (1, 2, 3):
            assert bench.run(f"verify {node}:tpdo1 {file}").code != 0
            assert bench.run(f"pdo {node}:tpdo1 --json").document["pdos"][0]["event_timer_ms"] == 0


def test_verify_of_other_pdos_is_about_these(file: Path) -> None:
    with Bench(NODES) as bench:
        assert bench.run(f"verify 2:tpdo1 {file}").code == 3
        ran = bench.run(f"verify 1:tpdo70 {file}")
        assert (ran.code, ran.stdout) == (1, "")


TORN = """first: {node_id: 1, tpdo: {1: {event_timer: 0}}}
second: {node_id: 2, rpdo: {1: {transmission: 255}, 3: {transmission: 255}}}
links:
  - {from: first:tpdo70, to: second:rpdo3}
  - {from: first:tpdo2, to: second:rpdo70}
  - {from: first:tpdo1, to: [second:rpdo1, second:rpdo71]}
"""


@pytest.mark.parametrize("pdo", ["2:rpdo3", "1:tpdo2"])
def test_verify_of_a_pdo_that_is_linked_with_a_lacked_one_says_what_is_lacked(pdo: str, tmp_path: Path) -> None:
    """Its COB-ID and mapping were not compared: the link says them."""
    (tmp_path / "l.yaml").write_text(TORN)
    with Bench(NODES) as bench:
        ran = bench.run(f"verify {pdo} {tmp_path / 'l.yaml'}")
        assert (ran.code, ran.stdout) == (1, "")
        assert "node 1 has no TPDO70" in ran.stderr


def test_verify_compares_what_another_node_lacks_and_what_is_linked_besides(tmp_path: Path) -> None:
    (tmp_path / "l.yaml").write_text(TORN + "third: {node_id: 3, tpdo: {70: {event_timer: 0}, 1: {event_timer: 0}}}\n")
    with Bench(NODES) as bench:
        ran = bench.run(f"verify 3:tpdo1 {tmp_path / 'l.yaml'}")
        assert (ran.code, "no TPDO70" in ran.stderr) == (0, False)
        ran = bench.run(f"verify 2:rpdo1 {tmp_path / 'l.yaml'}")
        assert (ran.code, "can_id" in ran.stdout.lower().replace("cob-id", "can_id")) == (3, True), ran.stdout


def test_verify_of_a_pdo_that_another_node_lacks_compares_it(tmp_path: Path) -> None:
    (tmp_path / "l.yaml").write_text(
        "one: {node_id: 1, tpdo: {5: {event_timer: 0}}}\ntwo: {node_id: 2, tpdo: {5: {event_timer: 50}}}\n"
    )
    with Bench(("generic@1", "gen4@2")) as bench:
        assert bench.run(f"verify 1:tpdo5 {tmp_path / 'l.yaml'}").code == 1
        ran = bench.run(f"verify 2:tpdo5 {tmp_path / 'l.yaml'}")
        assert (ran.code, "node 1 has no" in ran.stderr) == (3, False)


def test_no_stamp_stands_for_a_part_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(
        "one: {node_id: 1, store: true, stamp: true, tpdo: {1: {event_timer: 0}, 70: {event_timer: 0}}}\n"
    )
    with Bench(("generic@1",)) as bench:
        ran = bench.run(f"plan {tmp_path / 's.yaml'} --json")
        assert (ran.code, "1020" in ran.stdout) == (1, False)


def test_the_formats_of_ci_have_a_case_for_each(file: Path) -> None:
    with Bench(NODES) as bench:
        for word in ("diff", "verify"):
            ran = bench.run(f"{word} {file} --format junit")
            root = ET.fromstring(ran.stdout)  # noqa: S314 - our own
            assert (ran.code, root.attrib["failures"]) == (1, "5")
            ran = bench.run(f"{word} {file} --format github")
            assert f"::error file={file},line=6,title=node 1::TPDO70 of node 1: node 1 has no" in ran.stdout


def test_where_something_else_is_wrong_both_are_said(file: Path) -> None:
    file.write_text(FILE.replace("node_id: 2", "node_id: 2\n    sdo: [{object: no_such_name, value: 3}]"))
    with Bench(NODES) as bench:
        ran = bench.run(f"diff {file}")
        assert (ran.code, ran.stdout) == (4, "")
        for said in ("no_such_name", "node 1 has no TPDO70", "node 3 has no RPDO99"):
            assert said in ran.stderr


def test_a_program_is_told_the_rest_too_and_apply_refuses(file: Path) -> None:
    with dvtcli.simulate(*NODES) as bus:
        answer = bus.plan(file)
        assert not answer
        assert [(one.node_id, str(one.pdo)) for one in answer.plan.lacking] == LACKED
        assert answer.plan.writes == 2
        with pytest.raises(RuleError, match="no TPDO70"):
            bus.apply(file, yes=True, force=True)


#: single objects: one by number, one by a key of its own, one that is there and may not be set
OBJECTS = """a: {node_id: 1, tpdo: {1: {event_timer: 20}}, sdo: [{index: 0x2999, sub_index: 1, value: 5}]}
b: {node_id: 2, tpdo: {1: {event_timer: 70}}, sdo: [{index: 0x1017, value: 200}]}
c: {node_id: 3, sdo: [{object: 1017:7, value: 5}]}
"""


@pytest.mark.parametrize("word", ["diff", "plan", "verify"])
def test_an_object_that_a_device_lacks_does_not_hide_the_other_nodes(word: str, tmp_path: Path) -> None:
    file = tmp_path / "o.yaml"
    file.write_text(OBJECTS)
    with Bench(NODES) as bench:
        ran = bench.run(f"{word} {file}")
        assert ran.code == 1
        for said in ("TPDO1", "20", "70", "0x1017:00" if word != "verify" else "1017:00"):
            assert said in ran.stdout
        assert f"error: {file}:1:53: node 1 has no 0x2999:01: object does not exist" in ran.stderr
        assert "node 3 has no 0x1017:07: sub-index does not exist" in ran.stderr
        assert "nothing was compared" not in ran.stdout
        document = bench.run(f"{word} {file} --json").document
        assert [(one["node"], one["pdo"], one["object"]) for one in document["lacking"]] == [
            (1, None, "2999:01"), (3, None, "1017:07"),
        ]  # fmt: skip
        ran = bench.run(f"{word} {file} --format github")
        assert f"::error file={file},line=3,title=node 3::1017:07 of node 3: node 3 has no" in ran.stdout
        refused = bench.run(f"apply {file} --yes --force")
        assert (refused.code, refused.stdout) == (1, "")
        assert bench.run(f"verify 2:tpdo1 {file}").code == 3, "another node's PDO is compared"


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (FILE, [("pdo-lacking", "0x1845:01"), ("pdo-lacking", "0x1846:01"), ("pdo-lacking", "0x1462:01")]),
        (OBJECTS, [("object-lacking", "0x2999:01"), ("object-lacking", "0x1017:07")]),
        (f"{OBJECTS}d: {{node_id: 3, tpdo: {{9: {{event_timer: 5}}}}}}\n".replace("c: {node_id: 3", "c: {node_id: 4"),
         [("pdo-lacking", "0x1808:01"), ("object-lacking", "0x2999:01"), ("object-lacking", "0x1017:07")]),
    ],
)  # fmt: skip
def test_the_rule_that_refuses_what_is_lacked_is_named(text: str, found: list[tuple[str, str]], tmp_path: Path) -> None:
    file = tmp_path / "n.yaml"
    file.write_text(text)
    with Bench((*NODES, "generic@4")) as bench:
        ran = bench.run(f"apply {file} --yes --json")
        assert ran.code == 1
        assert sorted((one["rule"], one["place"]) for one in ran.document["findings"]) == sorted(found)
        assert bench.run("read 1:1800:5 --json").document["value"] == 0


def test_what_every_device_has_is_not_lacked(tmp_path: Path) -> None:
    file = tmp_path / "n.yaml"
    file.write_text("a: {node_id: 1, tpdo: {4: {event_timer: 20}}, sdo: [{index: 0x1017, value: 200}]}\n")
    with Bench(NODES) as bench:
        ran = bench.run(f"apply {file} --yes --json")
        assert ran.code == 0, ran.stderr
        assert 'lacking"' not in ran.stdout.replace('"lacking":[]', "")


def test_check_says_where_the_file_sets_what_a_device_lacks(tmp_path: Path) -> None:
    file = tmp_path / "o.yaml"
    file.write_text(OBJECTS.replace(", tpdo", ", dcf: generic, tpdo").replace("3, sdo", "3, dcf: generic, sdo"))
    with Bench(()) as bench:
        ran = bench.run(f"check {file}")
    assert ran.code == 4
    assert "o.yaml:1:67: error: node 1 has no 0x2999:01" in ran.stdout + ran.stderr
    assert "o.yaml:3:46: error: node 3 has no 0x1017:07" in ran.stdout + ran.stderr


def test_force_is_not_offered_where_it_would_not_help(tmp_path: Path) -> None:
    file = tmp_path / "o.yaml"
    file.write_text(OBJECTS + "d: {node_id: 4, sdo: [{index: 0x1018, sub_index: 1, value: 5}]}\n")
    with Bench((*NODES, "generic@4")) as bench:
        ran = bench.run(f"plan {file}")
        assert (ran.code, "--force" in ran.stderr) == (1, False)
        assert bench.run(f"plan {file} --force").code == 1

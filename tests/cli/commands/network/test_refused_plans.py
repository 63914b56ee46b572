"""What is said where a rule refuses what a file wants: what only looks changes nothing, and is offered nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench

NOT_MAPPABLE = """\
nodes:
  drive:
    node_id: 5
    tpdo:
      1:
        enabled: true
        cob_id: 0x185
        mapping: ["1018:1"]
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A network file with what no node takes."""
    path = tmp_path / "line.yaml"
    path.write_text(NOT_MAPPABLE, "utf-8")
    return path


@pytest.mark.parametrize("line", ["plan", "diff", "verify"])
def test_what_only_looks_does_not_say_that_force_sends_it(line: str, file: Path) -> None:
    with Bench(("gen4@5",)) as bench:
        ran = bench.run(f"{line} {file}")
        assert ran.code == 1
        assert ran.stderr.startswith(f"{file}:8:19: error: node 5: 1018:01")
        assert "not changed" not in ran.stderr
        assert "sends it" not in ran.stderr
        assert "nothing was written; --force continues anyway, and writes nothing" in ran.stderr
        assert bench.run(f"{line} {file} --force").code == (0 if line == "plan" else 3)
        assert "Statusword" in bench.run("pdo tpdo1").stdout


def test_of_several_nodes_each_is_named(tmp_path: Path) -> None:
    path = tmp_path / "line.yaml"
    second = NOT_MAPPABLE.replace("nodes:\n", "").replace("drive", "other").replace("5", "6")
    path.write_text(NOT_MAPPABLE + second, "utf-8")
    with Bench(("gen4@5", "gen4@6")) as bench:
        for line in (f"diff {path}", f"apply {path} --yes"):
            ran = bench.run(line)
            assert ran.stderr.startswith(f"{path}:8:19: error: node 5: 1018:01")
            assert f"{path}:15:19: error: node 6: 1018:01" in ran.stderr


def test_what_writes_says_so_and_a_forced_plan_names_what_carries_it_out(file: Path) -> None:
    with Bench(("gen4@5",)) as bench:
        ran = bench.run(f"apply {file} --yes")
        ran.failed(1, "nothing was written; --force sends it anyway")
        assert f"Next: dvtcli --sim gen4@5 apply {file} --force" in bench.run(f"plan {file} --force").stdout
        refused = bench.script(f"plan {file}")
        assert "and writes nothing" in refused.stderr
        assert "--force sends it anyway" in bench.script("map tpdo1 1018:1").stderr


@pytest.mark.parametrize("line", ["check {}", "plan {}", "apply {} --yes"])
def test_an_unknown_name_hides_no_other_entry_that_is_wrong(line: str, tmp_path: Path) -> None:
    """The PDO cannot be judged as a whole then; what is wrong with each of its entries is said all the same."""
    file = tmp_path / "net.yaml"
    words = "[no_such_name, 6041/8, 606C, 1018:1, 5FFF]"
    file.write_text(f"nodes:\n  a: {{node_id: 1, dcf: generic, tpdo: {{1: {{mapping: {words}}}}}}}\n")
    with Bench(("generic",)) as bench:
        ran = bench.run(line.format(file))
    said = ran.stdout + ran.stderr
    assert ran.code == 4
    column = 1 + file.read_text().splitlines()[1].index(words)
    for word, text in (
        ("no_such_name", "no object is named"),
        ("6041/8", "has 16 bits, only 8 were requested"),
        ("1018:1", "is not mappable"),
        ("5FFF", "0x5FFF is not in generic.eds"),
    ):
        at = f"{file}:2:{column + words.index(word)}: error: "
        (found,) = [row for row in said.splitlines() if row.startswith(at)]
        assert text in found
    assert "606C" not in "".join(row for row in said.splitlines() if ": error: " in row)


UNKNOWN = """\
nodes:
  drive:
    node_id: 5
    dcf: gen4
    tpdo:
      1: {{enabled: true, cob_id: 0x1A5, mapping: ["{entry}", "6041:00"]}}
  other:
    node_id: 6
    dcf: gen4
    rpdo:
      1: {{enabled: true, cob_id: 0x1A5, mapping: ["6040:00", "60FF:00"]}}
"""


@pytest.mark.parametrize("entry", ["6999:00", "6999:00/16", "6041:07", "nonsense_word"])
def test_no_link_is_judged_on_a_mapping_with_an_unknown_object(entry: str, tmp_path: Path) -> None:
    path = tmp_path / "line.yaml"
    path.write_text(UNKNOWN.format(entry=entry), "utf-8")
    with Bench(("gen4@5", "gen4@6")) as bench:
        for line in (f"plan {path}", f"check {path}"):
            ran = bench.run(line)
            said = ran.stdout + ran.stderr
            assert ran.code in (1, 4), ran
            assert f"{path}:6:51: error: " in said, said
            assert " error: node 6" not in said
    path.write_text(UNKNOWN.format(entry="6042:00"), "utf-8")
    with Bench(("gen4@5", "gen4@6")) as bench:
        assert "node 6 RPDO1: " in bench.run(f"check {path}").stdout


def test_an_error_of_a_linked_pdo_is_said_once(tmp_path: Path) -> None:
    path = tmp_path / "line.yaml"
    text = UNKNOWN.format(entry="6999:00").replace("cob_id: 0x1A5, ", "")
    path.write_text(f'{text}links:\n  - {{from: "5:tpdo1", to: "6:rpdo1"}}\n', "utf-8")
    with Bench(("gen4@5", "gen4@6")) as bench:
        ran = bench.run(f"plan {path}")
    assert ran.stderr.count("0x6999 is not in gen4.eds") == 1, ran.stderr


def test_the_hint_to_search_the_objects_names_the_node_of_each_finding(tmp_path: Path) -> None:
    path = tmp_path / "line.yaml"
    text = UNKNOWN.format(entry="6999:00").replace("6040:00", "6998:00")
    path.write_text(text, "utf-8")
    with Bench(("gen4@5", "gen4@6")) as bench:
        ran = bench.run(f"plan {path}")
    for node in (6,):
        assert f"-n {node} objects TEXT` searches the dictionary" in ran.stderr, ran.stderr

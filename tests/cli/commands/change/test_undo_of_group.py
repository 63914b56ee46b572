"""A plain `undo` reverts a change made on several nodes together on all of them, and says what it leaves otherwise."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench
from tests.process import run
from tests.simulator.serve.served import served

THREE = ("generic@1", "generic@5", "generic@9")
FILE = """nodes:
  a: {node_id: 1, profile: generic, tpdo: {1: {mapping: ["6041", 606C]}}}
  b: {node_id: 5, profile: generic, tpdo: {2: {event_timer: 40}}}
  c: {node_id: 9, profile: generic, tpdo: {2: {event_timer: 50}}}
"""
LINES = "map 1:tpdo1 6041 606C\nset 5:tpdo2 --timer 40\nset 9:tpdo2 --timer 50\nset 9:tpdo3 --timer 60\n"
#: the line that changes the nodes together
WAYS = {"apply": ("cell.yaml", "apply cell.yaml"), "atomic": ("cell.dvt", "run cell.dvt --atomic")}


@pytest.fixture(params=WAYS)
def together(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A line that changes three nodes together."""
    monkeypatch.chdir(tmp_path)
    name, line = WAYS[request.param]
    (tmp_path / name).write_text(FILE if name.endswith("yaml") else LINES, "utf-8")
    return line


def test_in_one_session_all_nodes_of_the_change_go_back_and_no_earlier_change(together: str) -> None:
    with Bench(THREE, {"yes": True}) as bench:
        nodes = [bench.session.node(node_id) for node_id in (1, 5, 9)]
        assert bench.run("set 5:tpdo1 --timer 7").code == 0
        before = [node.pdos() for node in nodes]
        assert bench.run(together).code == 0
        assert [node.pdos() for node in nodes] != before
        tried = bench.run("undo --dry-run --json").document
        assert {step["node"] for step in tried["steps"]} == {1, 5, 9}
        undone = bench.run("undo --json")
        assert undone.code == 0
        assert {step["node"] for step in undone.document["steps"]} == {1, 5, 9}
        assert [node.pdos() for node in nodes] == before
        assert bench.run("undo --json").document["node"] == 5
        assert bench.run("undo").code == 2


def test_a_node_that_holds_another_value_keeps_all_nodes_as_they_are(together: str) -> None:
    with Bench(THREE, {"yes": True}) as bench:
        nodes = [bench.session.node(node_id) for node_id in (1, 5, 9)]
        assert bench.run(together).code == 0
        nodes[1].sdo.download(0x1801, 5, bytes([33, 0]))
        held = [node.pdos() for node in nodes]
        refused = bench.run("undo --json")
        assert (refused.code, refused.document["state"]) == (6, "unchanged")
        assert [node.pdos() for node in nodes] == held


def test_the_chosen_node_alone_goes_back_and_the_others_are_named_even_if_quiet(together: str) -> None:
    with Bench(THREE, {"yes": True, "quiet": True}) as bench:
        nodes = [bench.session.node(node_id) for node_id in (1, 5, 9)]
        before = [node.pdos() for node in nodes]
        assert bench.run(together).code == 0
        held = [node.pdos() for node in nodes]
        assert bench.run("node 1").code == 0
        alone = bench.run("undo")
        assert alone.code == 0
        assert "the same change on nodes 5 and 9 is not undone by this: another `" in alone.stderr
        assert [node.pdos() for node in nodes] == [before[0], *held[1:]]
        assert bench.run("undo").code == 0, "the others still belong together"
        assert [node.pdos() for node in nodes] == before


def test_inside_an_atomic_script_undo_reverts_its_last_line(tmp_path: Path) -> None:
    script = tmp_path / "x.dvt"
    script.write_text("set 1:tpdo1 --timer 7\nset 5:tpdo1 --timer 8\nundo\n", "utf-8")
    with Bench(THREE) as bench:
        assert bench.run(f"run {script} --atomic").code == 0
        assert [bench.session.node(node_id).sdo.upload(0x1800, 5)[0] for node_id in (1, 5)] == [7, 0]


def test_in_a_script_of_lines_too(together: str, tmp_path: Path) -> None:
    sims = [word for name in THREE for word in ("--sim", name)]
    ran = run([*sims, "--yes", "--quiet", "run", "-"], stdin=f"{together}\nundo --json\n", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    document = json.loads(ran.stdout.splitlines()[-1])
    assert {step["node"] for step in document["steps"]} == {1, 5, 9}


def test_in_a_process_of_its_own(together: str, tmp_path: Path) -> None:
    with served(tmp_path, *THREE) as nodes:

        def held() -> list[str]:
            return [nodes.dvtcli("-n", node_id, "pdo", "--all", "--json").stdout for node_id in ("1", "5", "9")]

        assert nodes.dvtcli("-n", "5", "set", "tpdo1", "--timer", "7").returncode == 0
        before = held()
        changed = nodes.dvtcli("--yes", *together.split())
        assert changed.returncode == 0, changed.stderr
        after = held()
        alone = nodes.dvtcli("-n", "9", "--quiet", "undo", "--dry-run")
        assert alone.returncode == 0, alone.stderr
        assert "the same change on nodes 1 and 5 is not undone by this: `dvtcli " in alone.stderr
        assert "-n 1,5 undo` undoes it" in alone.stderr
        undone = nodes.dvtcli("undo", "--json")
        assert undone.returncode == 0, undone.stdout
        assert {step["node"] for step in json.loads(undone.stdout)["steps"]} == {1, 5, 9}
        assert held() == before != after
        assert json.loads(nodes.dvtcli("undo", "--json").stdout)["node"] == 5
        assert nodes.dvtcli("undo").returncode == 2


def test_a_node_that_is_gone_is_left_out_with_n(together: str, tmp_path: Path) -> None:
    with served(tmp_path, *THREE) as nodes:
        assert nodes.dvtcli("--yes", *together.split()).returncode == 0
    with served(tmp_path, *THREE[:2], port=nodes.port) as nodes:
        quick = ("--timeout", "0.3")
        for words in ((), ("--all",)):
            silent = nodes.dvtcli(*quick, "undo", *words)
            assert silent.returncode == 5
            assert f"-n 1,5 undo{' --all' if words else ''}` leaves node 9 out" in silent.stderr.replace("\n", " ")
        undone = nodes.dvtcli(*quick, "-n", "1,5", "undo", "--all")
        assert undone.returncode == 0, undone.stderr
        assert "the changes on node 9 stay: other nodes are selected" in undone.stderr

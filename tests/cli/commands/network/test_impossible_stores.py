"""A `store` of a network file that a device cannot do is refused before anything is written, with its place."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench

FILE = "nodes:\n  drive:\n    node_id: 1\n    store: {store}\n    tpdo: {{1: {{event_timer: 77}}}}\n"


def held(bench: Bench) -> object:
    return bench.run("read 1800:05 --json").document["value"]


@pytest.mark.parametrize(("family", "store"), [("gen4", "communication"), ("gen4", "3"), ("roboteq", "true")])
@pytest.mark.parametrize("line", ["plan {}", "apply {}", "apply {} --force", "apply {} --dry-run"])
def test_it_is_refused_before_any_write(tmp_path: Path, family: str, store: str, line: str) -> None:
    file = tmp_path / "net.yaml"
    file.write_text(FILE.format(store=store))
    with Bench((f"{family}@1",), {"yes": True}) as bench:
        before = held(bench)
        ran = bench.run(line.format(file))
        assert (ran.code, held(bench)) == (1, before)
        assert ran.stderr.startswith(f"error: {file}:4:5: store: {store} of node 1: this device cannot store")
        assert f"    4 |     store: {store}\n      |     ^^^^^\n" in ran.stderr
        assert "rule    store-impossible at 0x1010:" in ran.stderr
        assert "state   unchanged: nothing was written\n" in ran.stderr
        assert ("store: true stores group 0x1010:01 of the device" in ran.stderr) == (family == "gen4")
        document = bench.run(line.format(file) + " --json").documents[-1]
        assert (document["error"], document["findings"][0]["rule"]) == ("rules", "store-impossible")
        assert [(one["line"], one["column"]) for one in document["complaints"]] == [(4, 5)]


def test_every_node_that_cannot_is_said_at_once_and_the_others_are_not_written(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    timer = "tpdo: {1: {event_timer: 77}}"
    nodes = [f"  n{node_id}: {{node_id: {node_id}, {timer}}}\n" for node_id in (1, 2, 3)]
    file.write_text("defaults: {store: communication}\nnodes:\n" + "".join(nodes))
    with Bench(("gen4@1", "generic@2", "roboteq@3"), {"yes": True}) as bench:
        ran = bench.run(f"apply {file}")
        assert ran.code == 1
        assert "of node 1: this device" in ran.stderr
        assert "of node 3: this device" in ran.stderr
        assert "of node 2" not in ran.stderr
        assert bench.run("node 2").code == 0
        assert held(bench) == 0


def test_a_saved_plan_that_wants_it_is_refused_too(tmp_path: Path) -> None:
    file, saved = tmp_path / "net.yaml", tmp_path / "plan.json"
    file.write_text(FILE.format(store="true"))
    with Bench(("gen4@1",), {"yes": True}) as bench:
        assert bench.run(f"plan {file} -o {saved}").code == 0
        document = json.loads(saved.read_text())
        document["nodes"][0]["store"] = "communication"
        saved.write_text(json.dumps(document))
        before = held(bench)
        ran = bench.run(f"apply {saved}")
        assert (ran.code, held(bench)) == (1, before)
        assert "rule    store-impossible at 0x1010:02" in ran.stderr


def test_ci_is_told_where_the_file_asks_for_it(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    file.write_text(FILE.format(store="communication"))
    with Bench(("gen4@1",)) as bench:
        annotated = bench.run(f"plan {file} --format github")
        assert annotated.code == 1
        assert f"::error file={file},line=4,col=5,title=dvtcli::store: communication of node 1" in annotated.stdout
        assert f"{file}:4:5: store: communication of node 1" in bench.run(f"plan {file} --format junit").stdout

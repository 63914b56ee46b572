"""Names in a network file, on nodes that no EDS describes: what helps is said, and helps."""

from __future__ import annotations

from pathlib import Path

from tests.bus.devices import unknown
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy

FILE = "nodes:\n  one:\n    node_id: 1\n{more}    tpdo: {{1: {{mapping: [velocity_actual_value]}}}}\n"


def test_plan_names_what_gives_one_and_that_helps(tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(FILE.format(more=""))
    with Wire(unknown(1)) as wire:
        with Bench((), {**wire.options, "yes": True}) as bench:
            refused = bench.run(f"plan {path} --json")
        assert refused.code == 4
        (complaint,) = refused.documents[-1]["complaints"]
        assert (complaint["line"], complaint["column"]) == (4, 26)
        for word in ("`dcf: drive.eds`", "to the library", "numbers need no EDS"):
            assert word in complaint["text"]
        path.write_text(FILE.format(more="    dcf: generic\n"))
        with Bench((), {**wire.options, "yes": True}) as bench:
            ran = bench.run(f"plan {path} --json")
        assert (ran.code, ran.document["nodes"][0]["pdos"][0]["map"][1]) == (0, ["606C:00/32"])


def test_a_node_that_was_met_before_the_file_was_read_is_described_by_it(tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(FILE.format(more="    dcf: generic\n"))
    with Wire(device("generic")) as wire, Bench((), {**wire.options, "yes": True, "node": 1}) as bench:
        assert bench.run("set tpdo2 --timer 230").code == 0
        ran = bench.run(f"apply {path} --json")
        assert (ran.code, ran.documents[-1]["verified"]) == (0, True)
        assert bench.run("undo --all").code == 0, "what was done before is not forgotten"


def test_check_notes_it(tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(FILE.format(more=""))
    with Bench(()) as bench:
        note, skipped = bench.run(f"check {path} --json").document["files"][0]["notes"]
        assert "node 1: no EDS" in skipped["text"]
        assert "'velocity_actual_value' of node 1" in note["text"]
        for more in ("dcf: generic", "profile: generic"):
            path.write_text(FILE.format(more=f"    {more}\n"))
            assert bench.run(f"check {path} --json").document["files"][0]["notes"] == []


def test_a_saved_plan_keeps_why(tmp_path: Path) -> None:
    path, saved = tmp_path / "net.yaml", tmp_path / "plan.json"
    path.write_text("one: {node_id: 1, heartbeat_producer: 700}\n")
    with Bench(("generic@1",), {"yes": True}) as bench:
        assert bench.run(f"plan {path} -o {saved}").code == 0
        assert "0x1017:00  500 ms -> 700 ms  heartbeat_producer" in bench.run(f"apply {saved}").stdout


@heavy
def test_the_eds_of_a_served_family_goes_by_its_name(tmp_path: Path) -> None:
    with Wire(device("generic")) as wire:
        with Bench((), {**wire.options, "eds": "generic", "node": 1, "yes": True}) as bench:
            assert bench.run("map tpdo2 velocity_actual_value").code == 0
            imported = bench.run(f"import {tmp_path / 'net.yaml'} --json")
        assert imported.code == 0, imported.stderr
        with Bench((), {**wire.options, "yes": True}) as bench:
            assert bench.run(f"diff {tmp_path / 'net.yaml'}").code == 0, "the file names where the EDS is"


def test_what_is_neither_a_file_nor_a_family_is_said(tmp_path: Path) -> None:
    with Wire(device("generic")) as wire, Bench((), {**wire.options, "eds": "gen5", "node": 1}) as bench:
        refused = bench.run("pdo")
    assert refused.code == 2
    assert "a simulated family" in refused.stderr

"""`run --atomic`: a failing line takes back all lines before it, on all nodes; and what stays of other scripts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from dvtcli.device.change.applied import Progress
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.cli.commands.bench import Bench, Ran
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy
from tests.process import dvtcli

LINES = ("map tpdo1 606C --cob-id 0x6A1", "write 1017 700", "map 2:tpdo2 6041 --cob-id 0x6A2", "set tpdo1 --timer 70")


def atomic(bench: Bench, folder: Path, *lines: str, options: str = "") -> Ran:
    script = folder / "x.dvt"
    script.write_text("\n".join(lines))
    return bench.run(f"run {script} --atomic {options}")


def held(bench: Bench) -> list[Any]:
    """Every PDO and the heartbeat time of both nodes, read now."""
    found: list[Any] = []
    for node_id in (1, 2):
        assert bench.run(f"node {node_id}").code == 0
        found += [bench.run("pdo --all --json").document, bench.run("read 1017 --json").document["value"]]
    assert bench.run("node 1").code == 0
    return found


@pytest.fixture
def bench() -> Any:
    with Bench(("generic@1", "generic@2")) as made:
        yield made


def test_lines_that_all_work_stay(bench: Bench, tmp_path: Path) -> None:
    before = held(bench)
    assert atomic(bench, tmp_path, *LINES, "store", "verify").code == 0
    after = held(bench)
    assert [one == other for one, other in zip(before, after, strict=True)] == [False, False, False, True]


@heavy
@pytest.mark.parametrize(("wrong", "code"), [("read 5FFF", 1), ("map tpdo1 1018:1", 1), ("node 9", 5)])
def test_a_failing_line_takes_all_lines_back(bench: Bench, tmp_path: Path, wrong: str, code: int) -> None:
    assert bench.run("set tpdo3 --timer 33").code == 0
    before = held(bench)
    ran = atomic(bench, tmp_path, *LINES, wrong, "map tpdo4 6041", options="--json --timeout 0.2")
    assert ran.code == code, ran.stderr
    error = ran.documents[-1]
    assert (error["schema"], error["exit_code"], error["state"]) == ("dvtcli.error/1", code, "rolled_back")
    assert error["stays"] == []
    assert error["at"].endswith("x.dvt:5")
    assert held(bench) == before
    assert bench.session.record.lines == [(1, "set tpdo3 --timer 33")]
    assert bench.run("undo").code == 0, "what was changed before the script can be undone as ever"


def test_a_node_that_restarts_while_another_is_taken_back_is_not_called_as_it_was(bench: Bench, tmp_path: Path) -> None:
    steps: list[int] = []

    def took(step: Progress) -> None:
        steps.append(step.node)
        if steps == [2, 2, 1, 2, 1]:  # what the script did not store of node 2 is back in its RAM, and lost again
            bench.session.wire.send_nmt(NmtCommand.RESET_NODE, 2)
            assert bench.session.wire.wait_boot_up(2, 1, 10)

    bench.session.open_network().on_step = took
    assert bench.run("pdo tpdo1").code == 0
    assert bench.run("set 2:tpdo3 --timer 33").code == 0
    ran = atomic(bench, tmp_path, "set 2:tpdo3 --timer 44", "set 1:tpdo1 --timer 55", "read 5FFF", options="--json")
    assert steps == [2, 2, 1, 2, 1]
    assert (ran.code, ran.documents[-1]["state"]) == (7, "left_changed")
    assert ran.documents[-1]["why"].endswith("it restarted during the check")


def test_a_difference_is_a_failure_too(bench: Bench, tmp_path: Path) -> None:
    before = held(bench)
    other = tmp_path / "other.dvt"
    other.write_text("run " + str(tmp_path / "inner.dvt"))
    (tmp_path / "inner.dvt").write_text("map tpdo2 6041 --cob-id 0x6A7\nread 5FFF\n")
    ran = atomic(bench, tmp_path, LINES[0], f"run {other}")
    assert ran.code == 1
    assert "rolled back: the changes of the script are reverted and verified" in ran.stderr
    assert held(bench) == before


@heavy
def test_it_works_on_the_twin(bench: Bench, tmp_path: Path) -> None:
    before = held(bench)
    assert atomic(bench, tmp_path, *LINES, "store", options="--dry-run").code == 0
    ran = atomic(bench, tmp_path, *LINES, "read 5FFF", options="--dry-run --json")
    assert (ran.code, ran.documents[-1]["state"]) == (1, "unchanged")
    assert held(bench) == before


@pytest.mark.parametrize("options", ["--dry-run", ""])
def test_on_twins_too_all_that_was_set_is_still_held(options: str, tmp_path: Path) -> None:
    with Bench(("gen4@1", "gen4@2"), {"dry_run": not options}) as bench:
        assert bench.run("node 1").code == 0
        ran = atomic(bench, tmp_path, "map tpdo1 606C", "map 2:tpdo1 606C", options=options)
        assert (ran.code, ran.stderr) == (0, "")


@heavy
def test_the_nodes_go_back_to_operational(bench: Bench, tmp_path: Path) -> None:
    with Bench(("gen4@1", "gen4@2")) as gated:
        assert gated.run("nmt start all").code == 0
        before = gated.run("pdo --all --json").document
        ran = atomic(gated, tmp_path, "map tpdo1 606C --yes", "map 2:tpdo1 606C --yes", "read 5FFF")
        assert ran.code == 1
        assert gated.run("pdo --all --json").document == before
        states = [gated.run(f"node {node_id} --json").document["nodes"][0]["state"] for node_id in (1, 2)]
        assert states == ["OPERATIONAL", "OPERATIONAL"]


@pytest.mark.parametrize(
    "final",
    ["store", "restore --yes", "nmt reset-node", "nmt reset-comm 2", "nmt start all", "write 1010:1 save", "fpo op"],
)
@pytest.mark.parametrize("nested", [False, True])
def test_what_cannot_be_taken_back_stands_behind_the_last_change(
    bench: Bench, tmp_path: Path, final: str, nested: bool
) -> None:
    before = held(bench)
    inner = tmp_path / "inner.dvt"
    inner.write_text(f"# first\n{final}\n")
    lines = [LINES[0], f"run {inner}" if nested else final, "pdo -q", LINES[3]]
    ran = atomic(bench, tmp_path, *lines)
    assert ran.code == 2
    assert f"{inner if nested else tmp_path / 'x.dvt'}:2: `{final.split(maxsplit=1)[0]}" in ran.stderr
    assert f"{tmp_path / 'x.dvt'}:4 changes something after it" in ran.stderr
    assert held(bench) == before
    assert not bench.session.record.lines


@heavy
@pytest.mark.parametrize("final", ["store", "restore", "nmt reset-node", "write 1010:1 save", "fpo op", "run INNER"])
def test_what_is_done_to_a_twin_alone_is_not_final(bench: Bench, tmp_path: Path, final: str) -> None:
    inner = tmp_path / "inner.dvt"
    inner.write_text("set tpdo1 --timer 5\nstore\n")
    final = final.replace("INNER", str(inner))
    before = held(bench)
    assert atomic(bench, tmp_path, LINES[0], f"{final} --dry-run", LINES[3]).code == 0
    assert held(bench) != before
    before = held(bench)
    ran = atomic(bench, tmp_path, LINES[2], f"{final} --dry-run", "read 5FFF", options="--json")
    assert (ran.code, ran.documents[-1]["state"], ran.documents[-1]["stays"]) == (1, "rolled_back", [])
    assert held(bench) == before


def test_usage_errors(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "y.tcl").write_text("puts x")
    (tmp_path / "y.dvt").write_text("pdo -q")
    assert atomic(bench, tmp_path, *LINES, options="--keep-going").code == 2
    assert atomic(bench, tmp_path, f"run {tmp_path}/y.dvt --keep-going").code == 2
    assert atomic(bench, tmp_path, f"run {tmp_path}/y.tcl").code == 2
    assert bench.run(f"run {tmp_path}/y.tcl --atomic").code == 2
    assert not bench.session.record.lines


def test_a_line_that_fails_behind_a_store_is_left_changed(bench: Bench, tmp_path: Path) -> None:
    ran = atomic(bench, tmp_path, LINES[0], "store", "read 5FFF", options="--json")
    assert ran.code == 7
    assert (ran.documents[-1]["error"], ran.documents[-1]["state"]) == ("left_changed", "left_changed")
    assert ran.documents[-1]["stays"] == [f"{tmp_path}/x.dvt:1", f"{tmp_path}/x.dvt:2"]


STORES = "nodes: {{a: {{node_id: 1, store: {store}, tpdo: {{1: {{event_timer: 77}}}}}}}}"


@heavy
def test_an_apply_that_stores_stands_behind_the_last_change(bench: Bench, tmp_path: Path) -> None:
    file, saved = tmp_path / "net.yaml", tmp_path / "p.json"
    file.write_text(STORES.format(store="communication"))
    assert bench.run(f"plan {file} -o {saved}").code == 0
    before = held(bench)
    for name in (file, saved, tmp_path / "none.json"):
        ran = atomic(bench, tmp_path, f"apply {name} --yes", LINES[0])
        assert (ran.code, held(bench)) == (2, before)
        assert f"`store of apply {name}` cannot be rolled back" in ran.stderr
    assert atomic(bench, tmp_path, LINES[2], f"apply {file} --yes").code == 0
    file.write_text(STORES.format(store="false"))
    assert atomic(bench, tmp_path, f"apply {file} --yes", LINES[0]).code == 0


@pytest.mark.parametrize("store", ["communication", "true"])
@pytest.mark.parametrize("already", [True, False])
def test_what_an_apply_stored_is_not_called_taken_back(bench: Bench, tmp_path: Path, store: str, already: bool) -> None:
    file = tmp_path / "net.yaml"
    file.write_text(STORES.format(store=store))
    assert not already or bench.run("set 1:tpdo1 --timer 77").code == 0
    assert bench.run("write 6081 5 --as u32").code == 0  # in RAM only, and no part of `communication`
    ran = atomic(bench, tmp_path, LINES[2], f"apply {file} --yes", "read 5FFF", options="--json")
    assert (ran.code, ran.documents[-1]["state"]) == (7, "left_changed")
    assert bench.run("nmt reset-node all").code == 0
    assert bench.run("read 1800:05 --json").document["value"] == 77


@pytest.mark.long
def test_a_node_that_cannot_be_taken_back_is_7(tmp_path: Path) -> None:
    with Bench(("generic@1",), {"fault": ("silent@9",)}) as bench:
        ran = atomic(
            bench, tmp_path, "set tpdo1 --timer 7", "map tpdo2 606C", "map tpdo3 606C", options="--timeout 0.05"
        )
        assert ran.code == 7, ran.stderr


def test_other_scripts_say_which_lines_stay(bench: Bench) -> None:
    ran = bench.script("pdo -q", LINES[0], "set tpdo1 --timer 9 --json", "undo", "store", "read 5FFF --json")
    assert ran.code == 1
    assert ran.stdout.splitlines()[-1].count('"stays":["test.dvt:2","test.dvt:5"]') == 1
    ran = bench.script("pdo -q", "read 5FFF")
    assert "state   unchanged by this line\n" in ran.stderr


def test_a_line_with_dry_run_gets_a_fresh_twin() -> None:
    with Bench() as bench:
        before = bench.run("pdo tpdo1 --json").document
        for _ in range(2):
            ran = bench.run("map tpdo1 606C --dry-run --json")
            assert (ran.code, ran.document["dry_run"]) == (0, True)
            assert ran.document["writes"] > 0, "the twin of the line before is gone"
        assert bench.run("pdo tpdo1 --dry-run --json").document["pdos"] == before["pdos"]


@pytest.mark.parametrize(("options", "told"), [((), "the changes of <stdin>:1 stay"), (("--atomic",), "rolled back")])
def test_a_line_that_turns_out_wrong_as_it_runs_says_in_which_state_the_device_is(
    options: tuple[str, ...], told: str
) -> None:
    done = dvtcli("--sim", "tmcm", "run", "-", *options, stdin="set tpdo1 --timer 100\nverify tpdo3\n")
    assert done.returncode == 2
    assert told in done.stderr.rpartition("state")[2]


@pytest.mark.parametrize(
    ("line", "is_named"),
    [("recover", False), ("recover --accept", False), ("learn", False), ("store", True), ("nmt preop", True)],
)
def test_a_line_that_changed_nothing_is_not_named(line: str, *, is_named: bool) -> None:
    with Bench(("canopennode",), {"yes": True}) as bench:
        ran = bench.script(f"{line}\nmap tpdo1 9999\n")
    assert ran.code not in (0, 2, 5)
    assert ("the changes of test.dvt:1 stay" in ran.stderr) is is_named
    assert "unchanged by this line" in ran.stderr


def test_a_script_that_fails_behind_its_store_does_not_say_that_nothing_was_stored(tmp_path: Path) -> None:
    script = tmp_path / "x.dvt"
    script.write_text("set tpdo1 --timer 5\nstore\nread 5FFF\n")
    with Bench(("generic",), {"yes": True}) as bench:
        ran = bench.run(f"run {script} --atomic")
    assert ran.code == 7
    assert "LEFT CHANGED: TPDO1 of node 1; the changes of " in ran.stderr
    assert "nothing was stored" not in ran.stderr


class Refusing(StrictDevice):
    """A device that takes every NMT command but the one to start."""

    def nmt(self, command: int) -> None:
        if command != NmtCommand.START:
            super().nmt(command)


@heavy
@pytest.mark.parametrize("family", ["gen4", "generic"])
def test_a_start_of_all_that_one_node_does_not_obey_is_taken_back(family: str, tmp_path: Path) -> None:
    """The way back stops the nodes that the line itself had started: that was consented to with it."""
    refusing = Refusing(read_eds(family_eds(family)).dictionary, load_family(family), 2)
    with Wire(device(family, 1), refusing) as wire, Bench((), wire.options) as bench:
        before = [bench.session.node(node_id).pdos() for node_id in (1, 2)]
        lines = ("set 1:tpdo1 --timer 70", "set 2:tpdo1 --timer 70", "nmt start all")
        ran = atomic(bench, tmp_path, *lines)
        assert ran.code == 1, ran.stderr
        assert "node 2 is PRE-OPERATIONAL, not OPERATIONAL as commanded" in ran.stderr
        assert "rolled back" in ran.stderr
        assert [bench.session.node(node_id).pdos() for node_id in (1, 2)] == before
        if family == "gen4":
            assert "node 1 was OPERATIONAL and is PRE-OPERATIONAL now" in ran.stderr


def test_a_node_that_ran_before_the_script_runs_after_it_was_taken_back(tmp_path: Path) -> None:
    running = device("gen4", 1)
    with Wire(running) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.run("nmt start").code == 0
        ran = atomic(bench, tmp_path, "set tpdo1 --timer 70", "read 5FFF")
        assert ran.code == 1
        assert running.state is NmtState.OPERATIONAL


def test_an_apply_that_fails_in_its_stores_names_who_has_stored(tmp_path: Path) -> None:
    (tmp_path / "net.yaml").write_text(
        "defaults: {store: true, tpdo: {1: {transmission: 1}}}\nnodes: {a: {node_id: 1}, b: {node_id: 2}}\n"
    )
    (tmp_path / "x.dvt").write_text(f"apply {tmp_path}/net.yaml\n")
    with Bench(("generic@1", "generic@2"), {"yes": True, "fault": ("2:store-fails",)}) as bench:
        ran = bench.run(f"run {tmp_path / 'x.dvt'} --atomic")
    rows = dict(line.strip().split(None, 1) for line in ran.stderr.splitlines() if line.startswith("  "))
    assert (ran.code, rows["stored"], rows["unknown"]) == (7, "node 1", "node 2"), ran.stderr

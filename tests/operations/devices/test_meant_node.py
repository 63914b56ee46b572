"""Which node a file about one device is for: the selected one, else the file's own; never the latter for a clone."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.bench import Bench, beside
from tests.harness.sample import heavy
from tests.operations.devices.test_apply_file import made
from tests.simulator.bench import booted

SAID = "note: node 5, as in {}\n"


@pytest.fixture
def devices() -> list[StrictDevice]:
    return [booted("generic", node_id) for node_id in (4, 5)]


@heavy
@pytest.mark.parametrize("form", ["dcf", "jsonl"])
def test_without_a_selected_node_all_take_the_one_of_the_file(
    form: str, devices: list[StrictDevice], tmp_path: Path
) -> None:
    file = made(tmp_path, "generic", form, "set tpdo1 --timer 70", "write 1017 700")
    with Bench((), bus=beside(devices)) as bench:
        for line in ("diff", "verify", "verify tpdo1", "compare", "plan --exit-code"):
            ran = bench.run(f"{line} {file}")
            assert (ran.code, ran.stderr) == (3, SAID.format(file)), line
        cloned = bench.run(f"clone {file} --yes")
        cloned.failed(2, "no node is selected\n  hint    this writes to")
        assert f"{file} was made of node 5" in cloned.stderr
        for line in ("backup node.jsonl", "pdo"):
            assert (bench.run(line).code, bench.run(line).stderr[:27]) == (2, "error: no node is selected\n"), line
        assert bench.run("write 5:6040 6").code == 0
        assert bench.run(f"apply {file} --yes").code == 0
        assert [one.value(0x1017) for one in devices] == [b"\xf4\1", b"\xbc\2"]
        for line in ("diff", "verify", "verify tpdo1", "compare", "plan --exit-code"):
            assert bench.run(f"{line} {file}").code == 0, line


@heavy
def test_a_selected_node_goes_before_the_one_of_the_file(devices: list[StrictDevice], tmp_path: Path) -> None:
    file = made(tmp_path, "generic", "dcf", "write 1017 700")
    with Bench((), {"node": 4}, bus=beside(devices)) as bench:
        for line in ("diff", "verify", "compare"):
            ran = bench.run(f"{line} {file}")
            assert (ran.code, "as " not in ran.stderr) == (3, True), line
        assert bench.run("write 6040 6").code == 0
        assert bench.run(f"clone {file} --yes").code == 0
    assert [one.value(0x1017) for one in devices] == [b"\xbc\2", b"\xf4\1"]
    with Bench((), {"node": (4, 5)}, bus=beside(devices)) as bench:
        both = bench.run(f"verify tpdo1 {file}")
        assert both.code == 0
        assert [f"of node {node_id} equal" in both.stdout for node_id in (4, 5)] == [True, True]
        assert bench.run(f"verify {file}").code == 3, "node 5 is as it was"
        assert bench.run(f"compare {file}").code == 2
        assert bench.run("node 5").code == 0
        document = bench.run(f"diff {file} --json").document
        assert [one["node"] for one in document["nodes"]] == [5], "it was selected since"
    with Bench((), {"node": "all"}, bus=beside(devices)) as bench:
        for line in ("diff", "apply --yes", "verify", "clone --yes"):
            assert (bench.run(f"{line} {file}").code, bench.run(f"{line} {file}").stderr[:14]) == (
                2,
                "error: -n all:",
            ), line


def test_a_file_without_a_node_id_needs_a_selected_node(devices: list[StrictDevice], tmp_path: Path) -> None:
    file = made(tmp_path, "generic", "dcf")
    text = file.read_text("utf-8")
    assert "NodeID=5" in text
    file.write_text(text.replace("NodeID=5", ""), "utf-8")
    with Bench((), bus=beside(devices)) as bench:
        for line in ("diff", "verify", "compare", "plan", "apply --yes", "clone --yes"):
            ran = bench.run(f"{line} {file}")
            assert (ran.code, ran.stderr[:27]) == (2, "error: no node is selected\n"), line


def test_a_pdo_without_a_node_is_the_selected_ones(devices: list[StrictDevice], tmp_path: Path) -> None:
    file = made(tmp_path, "generic", "dcf")
    with Bench((), {"node": 5}, bus=beside(devices)) as bench:
        assert bench.run("set 5:rpdo1 --type 1").code == 0
        ran = bench.run(f"verify 4:tpdo2 rpdo1 {file}")
        assert (ran.code, "use one line for each node" in ran.stderr) == (2, True), "not RPDO1 of node 4"
        assert bench.run(f"verify 5:tpdo2 rpdo1 {file}").code == 3
        assert bench.run(f"verify 4:tpdo2 4:rpdo1 {file}").code == 0

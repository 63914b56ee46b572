"""`check`, `load` and `report` on a bus with nodes that send nothing by themselves: they are there all the same."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy

NODES = (1, 5, 40)
#: nothing is waited for: who is silent is not heard in three seconds either
COMMANDS = ("check --for 0 --json", "load --for 0 --json", "report {}/x.dot --for 0 --json")


@pytest.fixture
def wire() -> Iterator[Wire]:
    """Node 1 sends heartbeats; 5 and 40 have booted before anybody listens, and send none."""
    devices = [device("generic", node_id) for node_id in NODES]
    for one in devices[1:]:
        one.set_value(0x1017, 0, bytes(2))
    with Wire(*devices) as opened:
        yield opened


def _looked_at(ran: object, page: Path) -> set[int]:
    document = ran.document  # type: ignore[attr-defined]
    if page.exists():
        text = page.read_text("utf-8")
        return {int(node_id) for node_id in re.findall(r"^ +n(\d+) \[", text, re.MULTILINE)}
    if "files" in document:
        return {one["node"] for one in document["files"][0]["nodes"]}
    return {one["node"] for one in document["frames"]}


@heavy
@pytest.mark.parametrize("line", COMMANDS)
def test_a_node_without_heartbeat_is_found(wire: Wire, tmp_path: Path, line: str) -> None:
    wire.frames()
    with Bench((), {**wire.options, "sim": (), "node": None, "yes": True}) as bench:
        ran = bench.run(line.format(tmp_path))
        assert ran.code in (0, 3), ran.stderr
        assert _looked_at(ran, tmp_path / "x.dot") == set(NODES)
    asked = [one for one in wire.frames() if 0x601 <= one.arbitration_id < 0x680]
    assert {one.data[0] & 0xE0 for one in asked} <= {0x40, 0x60, 0x80, 0xA0}, "uploads, and nothing else"


@pytest.mark.parametrize("line", COMMANDS)
def test_a_list_of_nodes_keeps_the_others_unasked_and_says_so(wire: Wire, tmp_path: Path, line: str) -> None:
    wire.frames()
    with Bench((), {**wire.options, "sim": (), "node": (5, 1), "yes": True}) as bench:
        ran = bench.run(line.format(tmp_path))
        assert ran.code in (0, 3), ran.stderr
        assert _looked_at(ran, tmp_path / "x.dot") == {1, 5}
    assert {one.arbitration_id for one in wire.frames() if 0x601 <= one.arbitration_id < 0x680} == {0x601, 0x605}
    with Bench((), {**wire.options, "sim": (), "node": (5, 1), "yes": True}) as bench:
        said = " ".join(bench.run(line.format(tmp_path).removesuffix(" --json")).stderr.split())
        assert "nodes 5,1 as chosen, and known or received nodes; -n all searches for the other nodes" in said


def test_all_nodes_are_meant_by_all(wire: Wire) -> None:
    with Bench((), {**wire.options, "sim": (), "node": "all", "yes": True}) as bench:
        assert {one["node"] for one in bench.run("load --for 0 --json").document["frames"]} == set(NODES)

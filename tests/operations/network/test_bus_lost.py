"""A bus that is gone in the middle of a change of several nodes: what is said of them is so, and `recover` ends it.

Real processes: the nodes are served by one, dvtcli runs in another whose connection is cut, others see what is left.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import can
import pytest

from tests.operations.network.test_network_killed import FILE, held, is_download, is_save, journals
from tests.process import documents
from tests.simulator.serve.killing import Killable, killable

pytestmark = pytest.mark.drawn(4, "lost networks")

#: how many requests an `apply` of the file with stores sends, about, of which the last 60 or so look at what is stored
REQUESTS = 300


def is_request(frame: can.Message) -> bool:
    """Whether *frame* asks one of the nodes for anything."""
    return frame.arbitration_id in (0x601, 0x603)


@pytest.fixture
def nodes(tmp_path: Path) -> Iterator[Killable]:
    with killable(tmp_path, "generic@1", "generic@3") as made:
        (tmp_path / "net.yaml").write_text(FILE)
        (tmp_path / "stored.yaml").write_text("defaults: {store: true}\n" + FILE)
        yield made


def cut_off(
    nodes: Killable, words: Sequence[str], at: int, which: Callable[[can.Message], bool]
) -> tuple[int, dict[str, Any]]:
    """What dvtcli ended with whose bus was gone at the *at*-th of the frames that *which* tells."""
    code = nodes.cut_off(["--yes", "--json", *words], at, which)
    said = [one for one in documents(nodes.said) if one["schema"] == "dvtcli.error/1"]
    assert said, (code, nodes.said, nodes.complaints)
    return code, said[0]


def told_true(nodes: Killable, code: int, error: dict[str, Any], before: list[object]) -> None:
    """What *error* says is so; `recover` brings everything back where something is left."""
    assert error["exit_code"] == code
    if error["state"] in ("unchanged", "rolled_back"):
        assert (code, held(nodes), journals(nodes)) == (5, before, [])
        return
    assert (code, error["state"]) == (7, "left_changed"), error
    assert "recover" in error["hint"], error
    assert journals(nodes)
    recovered = nodes.dvtcli("recover", "--yes")
    assert recovered.returncode == 0, recovered.stderr
    assert (held(nodes), journals(nodes)) == (before, [])


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Ends of the bus spread over the requests of an `apply`, as many as `--kills` says."""
    if "gone_at" in metafunc.fixturenames:
        count = metafunc.config.getoption("--kills")
        metafunc.parametrize("gone_at", sorted({1 + number * REQUESTS // count for number in range(count)}))


@pytest.mark.counted
def test_wherever_apply_loses_the_bus_its_error_is_true(nodes: Killable, gone_at: int) -> None:
    before = held(nodes)
    code, error = cut_off(nodes, ["apply", str(nodes.folder / "stored.yaml")], gone_at, is_request)
    told_true(nodes, code, error, before)


@pytest.mark.parametrize("lost_at", [1, 4, 8, 12])
def test_nodes_that_were_written_are_left_changed(nodes: Killable, lost_at: int) -> None:
    before = held(nodes)
    code, error = cut_off(nodes, ["apply", str(nodes.folder / "net.yaml")], lost_at, is_download)
    assert (code, error["error"]) == (7, "left_changed")
    assert error["hint"].startswith("restore the bus first")
    told_true(nodes, code, error, before)


@pytest.mark.parametrize(("lost_at", "stored"), [(1, "unknown node 1"), (2, "stored node 1")])
def test_who_has_stored_is_said(nodes: Killable, lost_at: int, stored: str) -> None:
    before = held(nodes)
    code = nodes.cut_off(["--yes", "apply", str(nodes.folder / "stored.yaml")], lost_at, is_save)
    assert code == 7, nodes.complaints
    said = " ".join(nodes.complaints.split())
    assert "not every node is known to have the planned values" in said
    assert stored in said
    assert "restore the bus first" in said
    assert "nothing was written" not in said
    finished = nodes.dvtcli("recover", "--finish", "--yes")
    assert finished.returncode == 0, finished.stderr
    assert journals(nodes) == []
    assert nodes.dvtcli("diff", str(nodes.folder / "net.yaml")).returncode == 0
    assert held(nodes) != before


@pytest.mark.parametrize("lost_at", [1, 2])
def test_undo_of_several_nodes_is_left_changed_too(nodes: Killable, lost_at: int) -> None:
    for node_id in ("1", "3"):
        assert nodes.dvtcli("--yes", "-n", node_id, "set", "tpdo1", "--timer", "70").returncode == 0
    before = held(nodes)
    code, error = cut_off(nodes, ["undo", "--all"], lost_at, is_download)
    assert code == 7
    told_true(nodes, code, error, before)


LINES = "set 1:tpdo1 --timer 61\nset 3:tpdo1 --timer 62\n"


def of_node_3(frame: can.Message) -> bool:
    """Whether *frame* asks node 3 for anything."""
    return frame.arbitration_id == 0x603


def test_a_script_names_only_the_nodes_that_it_had_written_to(nodes: Killable) -> None:
    (nodes.folder / "x.dvt").write_text(LINES)
    before = held(nodes)
    code, error = cut_off(nodes, ["run", str(nodes.folder / "x.dvt"), "--atomic"], 15, of_node_3)
    assert (error["text"], error["also"]) == ("TPDO1 of node 1 could not be rolled back", [])
    told_true(nodes, code, error, before)


def test_a_script_that_had_written_nothing_leaves_nothing_changed(nodes: Killable) -> None:
    (nodes.folder / "x.dvt").write_text(LINES)
    before = held(nodes)
    code, error = cut_off(nodes, ["run", str(nodes.folder / "x.dvt"), "--atomic"], 10, is_request)
    assert error["error"] == "bus"
    told_true(nodes, code, error, before)


def is_reset(frame: can.Message) -> bool:
    """Whether *frame* resets a node."""
    return frame.arbitration_id == 0 and frame.data[0] == 0x81


def test_a_store_whose_proof_loses_the_bus_behind_the_reset_is_left_changed(nodes: Killable) -> None:
    """What tests the store may be in RAM, as far as anybody knows: 7, as its state says, and `recover` looks."""
    before = held(nodes)
    code, error = cut_off(nodes, ["-n", "1", "store", "--prove"], 1, is_reset)
    assert (code, error["error"]) == (7, "left_changed")
    assert error["hint"].startswith("restore the bus first")
    told_true(nodes, code, error, before)

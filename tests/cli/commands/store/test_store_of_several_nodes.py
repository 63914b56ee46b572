"""`-n 5,9 store`: all nodes are looked at before the first one stores; what fails later says who has stored."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench, beside
from tests.faults.matrix import stored_pdos
from tests.operations.network.bench import device

LINES = ["set 5:tpdo1 --timer 250", "map 9:tpdo1 6041 606C"]


def bench(tmp_path: Path, devices: list[object], *faults: str) -> Bench:
    options = {"yes": True, "journal": str(tmp_path), "eds": "generic", "node": (5, 9)}
    return Bench((), options, beside(devices, *faults))  # type: ignore[arg-type]


@pytest.mark.parametrize("store", ["store", "store --prove"])
@pytest.mark.parametrize("altered", ["1801:2:0x05", "1801:5:0x0063"])
def test_no_node_stores_if_another_one_altered_a_pdo_that_nobody_wrote(
    tmp_path: Path, altered: str, store: str
) -> None:
    devices = [device(node_id, "generic") for node_id in (5, 9)]
    stored = [stored_pdos(one) for one in devices]
    with bench(tmp_path, devices, f"9:enable-alters={altered}") as session:
        assert [session.run(line).code for line in LINES] == [0, 0]
        ran = session.run(store)
    assert ran.code == 6
    assert "node 9 is not stored: TPDO2 differs from its verified value" in ran.stderr
    assert [stored_pdos(one) for one in devices] == stored


def test_a_node_that_cannot_store_is_found_before_the_first_one_does(tmp_path: Path) -> None:
    devices = [device(node_id, "generic") for node_id in (5, 9)]
    devices[1].set_value(0x1010, 1, bytes(4))
    stored = [stored_pdos(one) for one in devices]
    with bench(tmp_path, devices) as session:
        ran = session.run("store")
    assert ran.code == 1
    assert [stored_pdos(one) for one in devices] == stored


def test_a_store_that_fails_behind_another_one_is_left_changed_and_says_who_stored(tmp_path: Path) -> None:
    devices = [device(node_id, "generic") for node_id in (5, 9)]
    with bench(tmp_path, devices, "9:store-fails") as session:
        ran = session.run("store --json")
    assert ran.code == 7
    error = ran.documents[-1]
    assert error["text"] == "node 5 stored, and node 9 refused to store: the stored values are unknown"
    assert (error["stores"]["stored"], error["stores"]["unknown"]) == ([5], [9])
    assert "-n 9 store` stores the rest" in error["hint"]

"""What one dvtcli changed, another one names when it stores it; what it cannot know it does not claim.

Real processes on a served node.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.simulator.serve.served import Served, served

MAP = ("map", "tpdo1", "6041", "606C")


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Served]:
    with served(tmp_path, "generic@1") as server:
        yield server


def run(server: Served, *words: str) -> str:
    ran = server.dvtcli("-n", "1", "--yes", *words)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


def store(server: Served, *words: str) -> dict[str, Any]:
    (document,) = map(json.loads, run(server, "--json", "store", *words).splitlines())
    assert isinstance(document, dict)
    return document


def test_the_proof_names_what_an_earlier_process_changed(server: Served) -> None:
    run(server, *MAP)
    run(server, "write", "6083", "500")
    stdout = run(server, "store", "--prove")
    assert "changed since the last store: TPDO1, 6083:00" in stdout
    assert "proved" in stdout
    assert "knows of no change" not in stdout


@pytest.mark.parametrize("words", [(), ("--prove",)])
def test_what_was_stored_is_not_named_again(server: Served, words: tuple[str, ...]) -> None:
    run(server, *MAP)
    assert store(server, *words)["changed"] == ["TPDO1"]
    again = store(server)
    assert (again["changed"], again["notes"]) == ([], ["the changes since the last store are unknown"])
    assert "changed since the last store: not known" in run(server, "store")
    run(server, "set", "tpdo2", "--timer", "70")
    assert store(server)["changed"] == ["TPDO2"]


def test_what_a_restart_took_is_not_claimed_as_stored(server: Served) -> None:
    run(server, *MAP)
    run(server, "set", "tpdo2", "--timer", "70")
    assert store(server)["changed"] == ["TPDO1", "TPDO2"]
    run(server, "set", "tpdo1", "--timer", "90")
    run(server, "nmt", "reset-node", "1")
    assert store(server)["changed"] == []
    run(server, "set", "tpdo1", "--timer", "90")
    assert store(server)["changed"] == ["TPDO1"]


def test_what_was_put_back_is_not_named(server: Served) -> None:
    run(server, *MAP)
    run(server, "undo")
    assert store(server)["changed"] == []


def test_a_group_leaves_the_rest_to_a_later_store(server: Served) -> None:
    run(server, *MAP)
    run(server, "write", "6083", "500")
    assert store(server, "communication")["changed"] == ["TPDO1"]
    assert store(server, "application")["changed"] == ["6083:00"]


def test_a_store_that_kept_nothing_is_no_store(tmp_path: Path) -> None:
    with served(tmp_path, "generic@1", "--fault", "stores-nothing") as server:
        run(server, *MAP)
        ran = server.dvtcli("-n", "1", "--yes", "store", "--prove")
        assert ran.returncode == 1
        assert "changed since the last store: TPDO1" in ran.stdout
        run(server, *MAP)
        assert store(server)["changed"] == ["TPDO1"]

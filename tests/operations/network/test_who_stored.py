"""Stores of a network that end before all nodes have stored: who has, in JSON, and what to do without a journal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.process import documents, dvtcli

FILE = """
defaults: {store: true, tpdo: {3: {event_timer: 70}}}
a: {node_id: 5}
b: {node_id: 9}
"""


def error(tmp_path: Path, fault: str, *words: str) -> tuple[int, dict[str, Any]]:
    """How a command on nodes 5 and 9 of this process ends, one of which has a *fault*."""
    (tmp_path / "net.yaml").write_text(FILE)
    (tmp_path / "x.dvt").write_text("set 5:tpdo1 --timer 9\napply net.yaml\n")
    nodes = ["--sim", "generic@5", "--sim", "generic@9", "--fault", fault]
    ran = dvtcli(*nodes, "--yes", "--json", *words, cwd=tmp_path)
    return ran.returncode, next(one for one in documents(ran.stdout) if one["schema"] == "dvtcli.error/1")


@pytest.mark.parametrize(
    ("fault", "stores"),
    [
        ("9:refuse@2=0x08000022", {"stored": [5], "not_stored": [9], "unknown": []}),
        ("9:store-fails", {"stored": [5], "not_stored": [], "unknown": [9]}),
        ("9:bus-error@2", {"stored": [5], "not_stored": [], "unknown": [9]}),
        ("5:bus-error@2", {"stored": [], "not_stored": [9], "unknown": [5]}),
    ],
)
def test_who_has_stored_is_in_the_document(tmp_path: Path, fault: str, stores: dict[str, list[int]]) -> None:
    code, told = error(tmp_path, fault, "apply", "net.yaml")
    assert (code, told["exit_code"], told["stores"]) == (7, 7, stores)


def test_a_node_that_does_not_keep_what_it_stores_is_not_among_those_that_stored(tmp_path: Path) -> None:
    code, told = error(tmp_path, "9:stores-nothing", "apply", "net.yaml", "--prove")
    assert (code, told["node"]) == (7, 9)
    assert told["stores"] == {"stored": [5], "not_stored": [], "unknown": [], "not_held": [9]}
    assert "store --prove` shows whether the stored values survive a reset" in told["hint"]


@pytest.mark.parametrize("fault", ["9:bus-error@1", "9:refuse@1=0x08000000"])
def test_where_nothing_is_stored_yet_the_document_has_none(tmp_path: Path, fault: str) -> None:
    code, told = error(tmp_path, fault, "apply", "net.yaml")
    assert (code, "stores" in told) == (told["exit_code"], False)


@pytest.mark.parametrize("words", [["apply", "net.yaml"], ["run", "x.dvt", "--atomic"]])
def test_without_a_journal_a_lost_bus_comes_first_too(tmp_path: Path, words: list[str]) -> None:
    code, told = error(tmp_path, "9:bus-error@2", *words)
    assert (code, told["state"]) == (7, "left_changed")
    assert told["hint"].startswith("restore the bus first")
    assert told["hint"].endswith(" apply FILE` again sets the missing values, and stores them")
    assert told["stores"] == {"stored": [5], "not_stored": [], "unknown": [9]}

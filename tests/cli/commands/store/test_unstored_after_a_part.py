"""What is unstored after a store of a part and an undo."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Locks of our own: others test on buses of the same name."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def unstored_after(*lines: str) -> list[str]:
    with Bench(("generic",), {"yes": True}) as bench:
        for line in lines:
            assert bench.run(line).code == 0, line
        return list(bench.session.node().unstored)


def test_an_undo_after_a_store_of_a_part_leaves_the_rest_unstored() -> None:
    lines = ("set tpdo1 --timer 5", "store application", "set tpdo2 --timer 6", "undo")
    assert unstored_after(*lines)[:1] == ["TPDO1"]


def test_an_undo_of_everything_after_a_store_of_a_part_differs_from_what_is_stored() -> None:
    lines = ("write 607A 500", "set tpdo1 --timer 5", "store application", "undo --all")
    assert "607A:00" in " ".join(unstored_after(*lines))


def test_an_undo_to_what_was_found_is_nothing_unstored_where_the_part_had_nothing_of_it() -> None:
    assert unstored_after("set tpdo1 --timer 5", "store application", "undo") == []


def test_a_store_of_all_that_was_changed_is_what_an_undo_goes_back_to() -> None:
    assert unstored_after("set tpdo1 --timer 5", "store communication", "set tpdo2 --timer 6", "undo") == []

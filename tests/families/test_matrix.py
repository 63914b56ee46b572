"""The same configuration on every family: equal frames where it is taken, else a rule's refusal, never an abort."""

from __future__ import annotations

from collections import defaultdict

import pytest

from tests.families.matrix import ABORTED, CONFIGURATIONS, REFUSED, TAKEN, Cell, cells, table


@pytest.fixture(scope="module")
def found() -> list[Cell]:
    return list(cells())


def test_no_abort_that_a_rule_could_have_foreseen(found: list[Cell]) -> None:
    assert not [cell for cell in found if cell.outcome == ABORTED], "\n".join(table(found))


def test_what_is_taken_makes_equal_frames(found: list[Cell]) -> None:
    frames: dict[str, set[object]] = defaultdict(set)
    for cell in found:
        if cell.outcome == TAKEN and CONFIGURATIONS[cell.name].startswith("map"):
            frames[cell.name].add(cell.frames[0])
    assert len(frames) > 15
    assert {name: len(kinds) for name, kinds in frames.items() if len(kinds) != 1} == {}


def test_a_refusal_names_its_reason(found: list[Cell]) -> None:
    refused = [cell for cell in found if cell.outcome == REFUSED]
    assert len(refused) > 100
    assert not [cell for cell in refused if not cell.why]


def test_a_locked_device_is_refused_for_that_alone(found: list[Cell]) -> None:
    """Where its unlocked twin takes a configuration; what another rule refuses, or is so already, is as there."""
    twin = {cell.name: cell for cell in found if cell.family == "gen4"}
    locked = [cell for cell in found if cell.family == "gen4-locked"]
    refused = [cell for cell in locked if cell.why == "access-level"]
    assert len(refused) > 10
    assert {twin[cell.name].outcome for cell in refused} == {TAKEN}
    for cell in locked:
        assert cell in refused or (cell.outcome, cell.why) == (twin[cell.name].outcome, twin[cell.name].why), cell.name

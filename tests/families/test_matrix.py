"""The same configuration on every family: equal frames where it is taken, else a rule's refusal, never an abort."""

from __future__ import annotations

import pytest

from tests.families.matrix import ABORTED, CONFIGURATIONS, NOWHERE, REFUSED, TAKEN, cell, cells, table


@pytest.mark.drawn(6)
@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_a_configuration_is_the_same_on_every_family_or_refused_beforehand(name: str) -> None:
    found = {cell.family: cell for cell in cells([name])}
    every = "\n".join(table([*found.values()]))
    outcomes = [cell.outcome for cell in found.values()]
    assert ABORTED not in outcomes, f"an abort that a rule could have foreseen\n{every}"
    assert (TAKEN not in outcomes) == (name in NOWHERE), every
    assert REFUSED in outcomes, "at least the locked one refuses it"
    if CONFIGURATIONS[name].startswith("map"):
        assert len({cell.frames[0] for cell in found.values() if cell.outcome == TAKEN}) <= 1, every
    assert all(cell.why for cell in found.values() if cell.outcome == REFUSED), every
    locked, twin = found["gen4-locked"], found["gen4"]
    if locked.why == "access-level":
        assert twin.outcome == TAKEN, "it is refused for that alone where its unlocked twin takes it"
    else:
        assert (locked.outcome, locked.why) == (twin.outcome, twin.why), "another rule refuses it, or it is so already"


@pytest.mark.parametrize("name", ["Sevcon 3", "controlword", "type 0", "disabled", "cleared"])
def test_a_locked_device_is_refused_for_that_alone(name: str) -> None:
    locked = cell("gen4-locked", name)
    assert (locked.outcome, locked.why) == (REFUSED, "access-level")

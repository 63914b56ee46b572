"""Virtual PDOs from Python: the answers and refusals of the command `vpdo`."""

from __future__ import annotations

import pytest

import dvtcli
from dvtcli.errors import DvtcliError, UsageError
from dvtcli.results import Changed, VpdoListing


def tied(node: dvtcli.Node, group: str) -> list[int | None]:
    """The indices that the active pins of *group* are tied to."""
    (found,) = node.vpdo(group).groups
    return [pin.index for pin in found.rows]


@pytest.mark.parametrize("object_", ["seat_switch", 0x2124])
def test_a_pin_is_tied_listed_and_put_back(object_: str | int) -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        before = tied(node, "digital-in")
        changed = node.tie("digital-in", 2, object_)
        assert isinstance(changed, Changed)
        assert [step.object for step in changed.plan.steps] == ["3300:02"]
        assert tied(node, "digital-in") == [before[0], 0x2124, *before[2:]]
        assert node.read(0x3300, "u8").value == len(before)
        assert isinstance(node.tie("digital-in", 2, object_), VpdoListing), "it is so already: nothing is written"
        assert node.undo()
        assert tied(node, "digital-in") == before


def test_every_pin_of_a_group_is_untied_at_the_node_that_was_asked_for() -> None:
    with dvtcli.simulate("gen4", "gen4@5") as bus:
        assert bus.node(5).tie("digital-in", None, None)
        assert tied(bus.node(5), "digital-in") == []
        assert len(tied(bus.node(1), "digital-in")) == 4
        assert len(bus.node(1).vpdo().groups) == 5


def test_a_dry_run_ties_nothing() -> None:
    with dvtcli.simulate("gen4") as bus:
        before = tied(bus.node(), "digital-in")
        with bus.dry_run():
            assert bus.node().tie("digital-in", None, None)
            assert tied(bus.node(), "digital-in") == []
        assert tied(bus.node(), "digital-in") == before


@pytest.mark.parametrize(
    ("config", "said"),
    [
        (("digital-in", 0, "throttle"), "a pin is 1…254"),
        (("digital-in", True, "throttle"), "a pin is 1…254"),
        (("digital-in", None, "throttle"), "can be unlinked together, but not linked"),
        (("digital-in", 1, 1.5), "an object's name or index"),
        (("digital-in", 1, -1), "an index is 0…65535"),
        (("digital-in", 1, "nonsense"), "no object is named 'nonsense'"),
        ((5, 1, "throttle"), "the name of a group"),
    ],
)
def test_a_wish_that_is_none_is_a_usage_error(config: tuple[object, ...], said: str) -> None:
    with dvtcli.simulate("gen4") as bus, pytest.raises(UsageError, match=said):
        bus.node().tie(*config)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("family", "group", "said"),
    [("gen4", "nix", "no virtual PDOs called 'nix'"), ("generic", "motor", "has no virtual PDOs")],
)
def test_a_node_without_such_a_group_says_which_it_has(family: str, group: str, said: str) -> None:
    with dvtcli.simulate(family) as bus:
        for call in (lambda: bus.node().vpdo(group), lambda: bus.node().tie(group, 1, None)):
            with pytest.raises(DvtcliError, match=said) as raised:
                call()
            assert raised.value.state == "unchanged"
            assert isinstance(raised.value, UsageError) == (group == "nix")

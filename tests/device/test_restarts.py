"""Which changes a node may hold after it restarted of its own accord."""

from __future__ import annotations

from dvtcli.device.node import Node
from dvtcli.domain.plan import Plan, Step, ValueChange
from tests.laws.bench import NODE, DirectBus, booted, dictionary


def after_a_restart(*, stored: int) -> tuple[list[Plan], list[Plan]]:
    """Three plans, of which group *stored* of 0x1010 was stored; with those that may be held once it restarted."""
    node = Node(DirectBus.of(booted()), NODE, dictionary("generic"))
    for place in ((0x1017, 0), (0x1800, 5), (0x6042, 0)):
        step = Step(*place, b"\0\0", b"\1\0", "write")
        node.history.append(Plan(NODE, (ValueChange(step),)))
        node.pending.changed(f"{place[0]:04X}", place[0])
    node.pending.was_stored(stored, len(node.history))
    node.pending.boot_ups = -1
    return node.history, node.plans_in_effect()


def test_what_was_stored_whole_is_held_after_a_restart() -> None:
    made, held = after_a_restart(stored=1)
    assert held == made


def test_where_a_part_was_stored_nothing_that_may_be_held_is_forgotten() -> None:
    made, held = after_a_restart(stored=2)
    assert held == made


def changed_after_a_store(*, restarted: bool | None) -> tuple[list[Plan], list[Plan]]:
    """Two plans, of which the first was stored, with those that may be held; None: never looked at since."""
    bus = DirectBus.of(booted())
    bus.heard_boot_ups = 1
    node = Node(bus, NODE, dictionary("generic"))
    for place in ((0x1017, 0), (0x1800, 5)):
        node.history.append(Plan(NODE, (ValueChange(Step(*place, b"\0\0", b"\1\0", "write")),)))
    node.pending.stored_at = 1
    node.pending.boot_ups = None if restarted is None else 1 - restarted
    return node.history, node.plans_in_effect()


def test_a_restart_takes_what_was_changed_after_the_store() -> None:
    made, held = changed_after_a_store(restarted=True)
    assert held == made[:1]
    for unseen in (False, None):
        made, held = changed_after_a_store(restarted=unseen)
        assert held == made

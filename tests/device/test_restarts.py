"""Which changes a node may hold after it restarted of its own accord."""

from __future__ import annotations

import math

import pytest

from dvtcli.device.node import Node
from dvtcli.domain.plan import Plan, Step, ValueChange
from dvtcli.errors import BusUnavailable, SafetyRefusal
from tests.bus.devices import device
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary
from tests.virtual_time import VirtualTimeBus


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


def restarted_after_an_order(within_s: float, *, changes: int) -> Node:
    """A node whose restart was ordered, which was changed that often since, and then restarts."""
    bus = VirtualTimeBus([device(NODE, "generic")], simulated=False)
    node = Node(bus, NODE, dictionary("generic"))
    node.restarts_at_read = bus.restarts(NODE)
    bus.order_restart(NODE, within_s)
    for number in range(changes):
        node.write(0x1017, 0, bytes([number + 1, 0]))
    bus.nodes[0].device.restart()
    bus.nodes[0].server.reset()
    bus.nodes[0].device.boot_up()
    bus.sleep(0.01)
    return node


@pytest.mark.parametrize("within_s", [10.0, math.inf])
def test_a_restart_that_was_ordered_is_no_surprise_unless_the_node_was_changed_since(within_s: float) -> None:
    """After a reset, and after a restore that asks its user to restart the node whenever he likes."""
    restarted_after_an_order(within_s, changes=0).require_not_restarted()
    for changes in (1, 2):
        with pytest.raises(SafetyRefusal, match="restarted since it was read"):
            restarted_after_an_order(within_s, changes=changes).require_not_restarted()


class GoneOnceVerified(DirectBus):
    """A bus that is gone when a change was read back."""

    def order_restart(self, node_id: int, within_s: float) -> None:
        raise BusUnavailable("the bus is gone")


def test_a_change_that_was_verified_can_be_undone_also_if_the_bus_is_gone_right_after() -> None:
    held = booted()
    node = Node(GoneOnceVerified(held, DirectSdo(held)), NODE, dictionary("generic"))
    node.write(0x1017, 0, b"\1\0")
    assert [change.label for plan in node.history for change in plan.changes] == ["1017:00"]

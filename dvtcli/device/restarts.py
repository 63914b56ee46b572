"""Unexpected restarts of nodes and their losses, as seen by the bus. Asks no node."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from dvtcli.errors import BusUnavailable, Restarted

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.plan import Plan


def held_plans(node: Node) -> list[Plan]:
    """The plans of this session still in effect on *node*, by the known resets, which clear unstored values.

    After a partial store nobody knows the stored plans: doubtful plans are listed.
    """
    pending, history = node.pending, node.history
    stored, since = history[: pending.stored_at], history[max(pending.stored_at, pending.lost_until) :]
    try:
        restarted = pending.boot_ups not in (None, node.bus.boot_ups(node.node_id))
    except BusUnavailable:
        restarted = False
    return stored if restarted and not pending.partly_stored else [*stored, *since]


def losses(nodes: Iterable[Node]) -> Iterator[str]:
    """A message for each node that restarted and lost changes since the last call."""
    for node in nodes:
        if lost := node.notice_reboot():
            yield f"node {node.node_id} restarted: unstored values are lost ({', '.join(lost)})"


def refuse_after_restarts(nodes: Iterable[Node]) -> None:
    """Raise Restarted if a node has lost changes of this script or command: its result does not hold."""
    for text in losses(nodes):
        raise Restarted(text, hint="check its supply, then repeat the command", state="unknown")

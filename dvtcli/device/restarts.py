"""Nodes that restarted of their own accord, and what they lost by that. Asks no node; the bus has heard it or not."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from dvtcli.errors import BusUnavailable, Restarted

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.plan import Plan


def held_plans(node: Node) -> list[Plan]:
    """The plans of this session whose changes *node* holds, as far as it was heard: a reset takes what is unstored.

    Where only a part was stored nobody says of which plans: what may be held is listed rather than forgotten.
    """
    pending, history = node.pending, node.history
    stored, since = history[: pending.stored_at], history[max(pending.stored_at, pending.lost_until) :]
    try:
        restarted = pending.boot_ups not in (None, node.bus.boot_ups(node.node_id))
    except BusUnavailable:
        restarted = False
    return stored if restarted and not pending.partly_stored else [*stored, *since]


def losses(nodes: Iterable[Node]) -> Iterator[str]:
    """What to say of each of *nodes* that restarted since somebody asked last, and lost what was set."""
    for node in nodes:
        if lost := node.notice_reboot():
            yield f"node {node.node_id} restarted: what was not stored is lost ({', '.join(lost)})"


def refuse_after_restarts(nodes: Iterable[Node]) -> None:
    """A script, and a command of its own, has not done what it says where a node lost that again: raise Restarted."""
    for text in losses(nodes):
        raise Restarted(text, hint="look at its supply, then do it all again", state="unknown")

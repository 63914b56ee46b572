"""How far the stores of a network had come when the process that asked for them ended, as its journals say.

Reads no files and no nodes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dvtcli.device.change.change_group import GroupMember
    from dvtcli.device.change.journal import Journal


def furthest(journals: Sequence[Journal]) -> GroupMember:
    """Of the journals that say how far the stores had come the one that says most: they are written one by one.

    The store of a node whose own journal is among them was not accepted: who began to say so did not come to its end.
    """
    part = max((journal.part for journal in journals), key=lambda part: (len(part.stores), *_progress(part)))
    open_ids = {journal.plan.node_id for journal in journals}
    stores = tuple(
        replace(store, is_accepted=store.is_accepted and store.node_id not in open_ids) for store in part.stores
    )
    return replace(part, stores=stores)


def _progress(part: GroupMember) -> tuple[int, int, int]:
    """How many nodes were accepted, how many answered their store, and how many were asked."""
    return (
        sum(store.is_accepted for store in part.stores),
        sum(store.is_done or store.is_refused for store in part.stores),
        sum(store.is_begun for store in part.stores),
    )


def waiting(part: GroupMember) -> list[int]:
    """Node-IDs of the stores of *part* that are not known to be done, and not over: what was accepted stays so."""
    return [store.node_id for store in part.stores if store.waits]


def stores_of(part: GroupMember) -> dict[str, list[int]]:
    """The nodes of *part* that stored, those that may have, and those that refused or were not asked yet."""
    done = [store.node_id for store in part.stores if store.is_done]
    asked = [store.node_id for store in part.stores if store.is_begun and store.waits and not store.is_refused]
    if not any(
        store.is_begun for store in part.stores
    ):  # an earlier version, which noted nothing else: they go in turn
        asked = waiting(part)[:1]
    return {"stored": done, "unknown": asked, "not stored": [area for area in waiting(part) if area not in asked]}


def stored_before(journal: Journal, journals: Sequence[Journal]) -> bool | None:
    """Whether the node of *journal* stored before its process ended; None where nobody knows.

    *journals* are all that wait, in which the others of its whole are.
    """
    ours = (
        [own_journal for own_journal in journals if own_journal.part.whole == journal.part.whole]
        if journal.part.whole
        else [journal]
    )
    part = furthest(ours)
    if not part.stores:
        return None if journal.part.final else False  # a line of a script stores, and may name any node
    states = stores_of(part)
    if journal.plan.node_id in states["stored"]:
        return True
    return None if journal.plan.node_id in states["unknown"] else False

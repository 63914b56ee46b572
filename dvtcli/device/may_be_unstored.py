"""Changes of dvtcli that a node may not have stored. Reads at most the node's identity."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from dvtcli.device.unstored import last_unstored
from dvtcli.domain.plan import alters

if TYPE_CHECKING:
    from dvtcli.device.node import Node


def may_be_unstored(node: Node, labels: Iterable[str]) -> set[str]:
    """The labels of changes by dvtcli that *node* may not have stored.

    All *labels* if the stored values are no state of this session, as after a partial store.
    """
    pending, wanted = node.pending, set(labels)
    if pending.partly_stored or len(node.history) < pending.stored_at:
        return wanted
    since = node.history[max(pending.stored_at, pending.lost_until) :]
    unstored = {change.label for plan in since for change in plan.changes if alters(change)}
    if node.keeper is not None:
        unstored |= last_unstored(node, node.keeper.past, node.identity()).keys()
    return wanted & unstored

"""What a node may hold otherwise than it has stored, as far as changes of dvtcli go. Reads who the node is at most."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from dvtcli.device.unstored import last_unstored
from dvtcli.domain.plan import alters

if TYPE_CHECKING:
    from dvtcli.device.node import Node


def may_be_unstored(node: Node, labels: Iterable[str]) -> set[str]:
    """Those of *labels* that *node* may hold otherwise than it has stored, as far as changes of dvtcli go.

    All of them where what is stored is no state of this session, as after a part was stored.
    """
    pending, wanted = node.pending, set(labels)
    if pending.partly_stored or len(node.history) < pending.stored_at:
        return wanted
    since = node.history[max(pending.stored_at, pending.lost_until) :]
    unstored = {change.label for plan in since for change in plan.changes if alters(change)}
    if node.keeper is not None:
        unstored |= last_unstored(node, node.keeper.past, node.identity()).keys()
    return wanted & unstored

"""Which heartbeats are missing, said once, for all nodes together, and not each time where they come and go.

Does not know when a heartbeat is overdue, nor where texts are shown.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

from dvtcli.domain.several import join_some

#: So many messages about one node in so much time (s); what it comes to is said afterwards.
MOST, WITHIN_S = 2, 10.0


class Silences:
    """The nodes whose heartbeats were said to be missing."""

    def __init__(self) -> None:
        self._missing: set[int] = set()
        self._told_s: dict[int, deque[float]] = {}

    def heard_of(self, silences: Mapping[int, tuple[float, bool]], now_s: float) -> list[str]:
        """What is news at *now_s* of *silences*: by node-ID the age (s) of the last heartbeat, and if it is overdue."""
        news = [
            node_id
            for node_id, (_, overdue) in silences.items()
            if overdue != (node_id in self._missing) and self._may_tell(node_id, now_s)
        ]
        gone = [node_id for node_id in news if silences[node_id][1]]
        back = [node_id for node_id in news if not silences[node_id][1]]
        self._missing |= set(gone)
        self._missing -= set(back)
        return [*_gone(gone, silences), *_back(back)]

    def started(self, node_id: int) -> None:
        """The node started anew: its silence before that is over."""
        self._missing.discard(node_id)

    def _may_tell(self, node_id: int, now_s: float) -> bool:
        told_s = self._told_s.setdefault(node_id, deque(maxlen=MOST))
        if len(told_s) == MOST and now_s - told_s[0] < WITHIN_S:
            return False
        told_s.append(now_s)
        return True


def _gone(node_ids: list[int], silences: Mapping[int, tuple[float, bool]]) -> list[str]:
    if not node_ids:
        return []
    ages_s = sorted(silences[node_id][0] for node_id in node_ids)
    if len(node_ids) == 1:
        return [f"node {node_ids[0]}  no heartbeat any more: the last one came {ages_s[0]:.1f} s ago"]
    ids = join_some([str(node_id) for node_id in sorted(node_ids)])
    return [f"node {ids}  no heartbeat any more: the last ones came {ages_s[0]:.1f} to {ages_s[-1]:.1f} s ago"]


def _back(node_ids: list[int]) -> list[str]:
    if not node_ids:
        return []
    ids = join_some([str(node_id) for node_id in sorted(node_ids)])
    return [f"node {ids}  heartbeat is back" if len(node_ids) == 1 else f"node {ids}  heartbeats are back"]

"""How long is listened, batch by batch: frames are gathered for a moment before they are handed on. Knows no bus."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

#: how long frames are gathered before they are handed on (s)
BATCH_S = 0.05


class ListeningTime:
    """*duration_s* seconds from *began_s* on (None: from now on), None for ever, by the clock *now_s* (s)."""

    def __init__(
        self, duration_s: float | None, now_s: Callable[[], float] = monotonic, began_s: float | None = None
    ) -> None:
        self._now_s = now_s
        self._until_s = None if duration_s is None else (now_s() if began_s is None else began_s) + duration_s

    def is_over(self) -> bool:
        """Whether all of it has passed."""
        return self._until_s is not None and self._now_s() >= self._until_s

    @property
    def batch_s(self) -> float:
        """How long to wait for the next frames (s): no longer than is left."""
        return BATCH_S if self._until_s is None else min(BATCH_S, max(0.0, self._until_s - self._now_s()))

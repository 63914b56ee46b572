"""Statistics of transmission delays: maximum and 99 % quantile."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from math import ceil, log2

#: histogram steps per doubling: results are at most 9 % too high
_STEPS = 8
_FLOOR_S = 1e-6


@dataclass(slots=True)
class Lateness:
    """Statistics of delays, as a histogram."""

    #: maximum, None without delays
    most_s: float | None = None
    _often: Counter[int] = field(default_factory=Counter)

    def add(self, late_s: float) -> None:
        """Add a delay of *late_s* seconds; early counts as in time."""
        late_s = max(late_s, 0.0)
        self.most_s = max(self.most_s or 0.0, late_s)
        self._often[ceil(_STEPS * log2(max(late_s, _FLOOR_S) / _FLOOR_S))] += 1

    def nearly_all_s(self) -> float | None:
        """The 99 % quantile in seconds; None without delays."""
        if self.most_s is None:
            return None
        left = 0.99 * self._often.total()
        for step, often in sorted(self._often.items()):
            left -= often
            if left <= 0:
                return min(_FLOOR_S * 2 ** (step / _STEPS), self.most_s)
        return self.most_s

"""How the monitor is looked at, and what its picture is of.

Does not know what is on the bus, nor how it is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

TABLE, RAW, GRAPH = "table", "raw", "graph"


@dataclass(slots=True)
class View:
    """How the user looks at it: *mode*, the *filter* (being typed while *typing*), and the *chosen* signal's number."""

    mode: str = TABLE
    filter: str = ""
    typing: bool = False
    paused: bool = False
    chosen: int = 0
    plain: bool = False
    changes: bool = False
    #: the first line of the body that is shown
    top: int = 0
    #: lines by which the body is scrolled beyond the last signal
    beyond: int = 0

    def choose(self, step: int, count: int) -> None:
        """Choose another one of *count* signals; behind the last one scroll, back from there first."""
        place = self.chosen + self.beyond + step
        self.chosen = max(0, min(count - 1, place))
        self.beyond = 0 if self.mode == GRAPH else max(0, place - self.chosen)


@dataclass(frozen=True, slots=True)
class Moment:
    """What the picture is of: bus *name*, seconds since the start, frames *dropped*, and the time (s since 1970).

    *gone_s* is how long the bus is gone (s), None while it is there; *reading* the node whose mapping is being read.
    """

    name: str
    running_s: float
    dropped: int
    now_s: float
    gone_s: float | None = None
    reading: int | None = None

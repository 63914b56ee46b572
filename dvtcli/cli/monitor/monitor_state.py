"""The view settings of the monitor, and the moment of its picture."""

from __future__ import annotations

from dataclasses import dataclass

TABLE, RAW, GRAPH, PICTURE = "table", "raw", "graph", "picture"


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
    #: kinds of frames that are shown, as in `typed_frame.READ_KINDS`; none: all
    only: frozenset[str] = frozenset()
    #: the first visible line of the body
    top: int = 0
    #: lines scrolled beyond the last signal
    beyond: int = 0
    #: what the keys started, in words
    marks: tuple[str, ...] = ()

    def choose(self, step: int, count: int) -> None:
        """Select another of *count* signals; after the last scroll, and scroll back first."""
        place = self.chosen + self.beyond + step
        self.chosen = max(0, min(count - 1, place))
        self.beyond = 0 if self.mode in (GRAPH, PICTURE) else max(0, place - self.chosen)


@dataclass(frozen=True, slots=True)
class Moment:
    """The moment of the picture: bus *name*, seconds since start, frames *dropped*, and time (s since 1970).

    *gone_s* is the time since the bus was lost (s), None if present; *reading* is the node whose mapping is being read.
    """

    name: str
    running_s: float
    dropped: int
    now_s: float
    gone_s: float | None = None
    reading: int | None = None

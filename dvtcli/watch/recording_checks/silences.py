"""Why a node did not answer an SDO request: it was STOPPED, or sent no heartbeat (CiA 301, 7.2.4.3 and 7.3.2.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from dvtcli.watch.recording_checks.beats import LATE_AFTER_PERIODS, PeriodicFrames
from dvtcli.watch.recording_checks.problems import Moment


@dataclass(slots=True, eq=False)
class Silence:
    """The time after *begin*, one of a node's *heartbeats*, in which the node was asked.

    *end* is the next heartbeat, a start of the node or a write of its period; None: there was none.
    """

    begin: Moment
    heartbeats: PeriodicFrames
    is_answered: bool
    end: Moment | None = None

    def text(self, last: Moment) -> str:
        """Say what to look at first if this took too long in a recording until *last*; else empty."""
        period_s, end = self.heartbeats.period_s, self.end or last
        silent_s = end.time_s - self.begin.time_s
        if self.is_answered or not period_s or silent_s <= LATE_AFTER_PERIODS * period_s:
            return ""
        how_long = "" if self.end is None else f"for {silent_s:.3g} s "
        return f"whether the node was on: it sent no heartbeat {how_long}after frame {self.begin.number}"


class Stop(NamedTuple):
    """What showed that a node is STOPPED: the NMT stop or a heartbeat, at *moment*."""

    what: str
    moment: Moment

    @property
    def text(self) -> str:
        """Say it as what to look at first."""
        return f"{self.what} in frame {self.moment.number}: a STOPPED node answers no SDO request"


class Asked(NamedTuple):
    """A request to *node_id* at *moment*: the node's stop and silence at that time."""

    node_id: int
    moment: Moment
    stop: Stop | None
    silence: Silence | None


class Cause(NamedTuple):
    """What may explain that a request was not answered."""

    stop: Stop | None = None
    silence: Silence | None = None

    def text(self, last: Moment) -> str:
        """Say it as what to look at first, in a recording until *last*; empty if nothing is known."""
        if self.stop is not None:
            return self.stop.text
        return "" if self.silence is None else self.silence.text(last)

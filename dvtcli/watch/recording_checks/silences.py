"""Causes of an unanswered SDO request: a STOPPED node, or a node without heartbeats (CiA 301, 7.2.4.3 and 7.3.2.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from dvtcli.watch.recording_checks.beats import LATE_AFTER_PERIODS, PeriodicFrames
from dvtcli.watch.recording_checks.problems import Moment


@dataclass(slots=True, eq=False)
class Silence:
    """The time without a heartbeat after *begin*, a node's last heartbeat before an SDO request.

    *end* is the next heartbeat, NMT reset, boot-up or write of the heartbeat period (0x1017), None if there is none.
    """

    begin: Moment
    heartbeats: PeriodicFrames
    is_answered: bool
    end: Moment | None = None

    def text(self, last: Moment) -> str:
        """Return what to check first if heartbeats were late, else an empty text; *last* ends the recording."""
        period_s, end = self.heartbeats.period_s, self.end or last
        silent_s = end.time_s - self.begin.time_s
        if self.is_answered or not period_s or silent_s <= LATE_AFTER_PERIODS * period_s:
            return ""
        how_long = "" if self.end is None else f"for {silent_s:.3g} s "
        return f"whether the node was on: it sent no heartbeat {how_long}after frame {self.begin.number}"


class Stop(NamedTuple):
    """Evidence that a node is STOPPED: *what* is an NMT stop or a heartbeat, at *moment*."""

    what: str
    moment: Moment

    @property
    def text(self) -> str:
        """Return what to check first."""
        return f"{self.what} in frame {self.moment.number}: a STOPPED node answers no SDO request"


class NodeAtRequest(NamedTuple):
    """The state of node *node_id* at the *moment* of an SDO request to it."""

    node_id: int
    moment: Moment
    stop: Stop | None
    silence: Silence | None


class Cause(NamedTuple):
    """A possible cause of an unanswered SDO request."""

    stop: Stop | None = None
    silence: Silence | None = None

    def text(self, last: Moment) -> str:
        """Return what to check first, empty if no cause is known; *last* is the end of the recording."""
        if self.stop is not None:
            return self.stop.text
        return "" if self.silence is None else self.silence.text(last)

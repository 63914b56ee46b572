"""One object that is read again and again: what it held, when that was, and why it cannot be read. Reads nothing."""

from __future__ import annotations

from dataclasses import dataclass, field

from dvtcli.domain.datatypes import Value
from dvtcli.watch.decoder import Signal
from dvtcli.watch.statistics import ValueHistory


@dataclass(slots=True)
class WatchedObject:
    """The object of *node* that *signal* names; *problem* is why it could not be read the last time, empty if it was.

    *read_s* is when it was read last (s since 1970), None where it never was.
    """

    node: int
    signal: Signal
    course: ValueHistory = field(default_factory=ValueHistory)
    read_s: float | None = None
    problem: str = ""

    def take(self, signal: Signal, value: Value, time_s: float) -> None:
        """It held *value* at *time_s*; *signal* says what is known of it."""
        self.signal, self.read_s, self.problem = signal, time_s, ""
        self.course.take(value, time_s)

    def fail(self, problem: str) -> None:
        """It could not be read, as *problem* says; what it held before stays."""
        self.problem = problem

"""An object that is read repeatedly: last value, time, and error. Reads nothing."""

from __future__ import annotations

from dataclasses import dataclass, field

from dvtcli.domain.datatypes import Value
from dvtcli.watch.decoder import Signal
from dvtcli.watch.statistics import ValueHistory


@dataclass(slots=True)
class WatchedObject:
    """The object *signal* of *node*; *problem* is the error of the last read, empty for none.

    *read_s* is the time of the last successful read (s since 1970), None for none.
    """

    node: int
    signal: Signal
    history: ValueHistory = field(default_factory=ValueHistory)
    read_s: float | None = None
    problem: str = ""

    def take(self, signal: Signal, value: Value, time_s: float) -> None:
        """Note *value* at *time_s*; *signal* is its description."""
        self.signal, self.read_s, self.problem = signal, time_s, ""
        self.history.take(value, time_s)

    def fail(self, problem: str) -> None:
        """Note a failed read with *problem*; the last value stays."""
        self.problem = problem

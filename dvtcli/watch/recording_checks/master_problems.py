"""Two masters on a bus: two SDO clients of one node, and NMT commands that undo each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from dvtcli.domain.lint.lint_rule import WARNING, LintRule
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.text import plural
from dvtcli.watch.recording_checks.problems import Moment, Moments, Problem, TimesOf
from dvtcli.watch.recording_checks.sdo_problems import Channel
from dvtcli.watch.sdo_transfers import SdoStep

TWO_MASTERS = LintRule(
    "two-masters", WARNING, "there seem to be two masters on the bus: SDO clients, or senders of NMT commands",
    "CiA 301, 7.2.4.3.1 and 7.2.8.3.1",
)  # fmt: skip
MASTER_RULES = (TWO_MASTERS,)
#: no client gives up a transfer so fast (s)
_SAME_CLIENT_S = 0.01
#: how often NMT commands undo each other until two masters are likely, and within what time (s)
_REVERSALS, _REVERSED_S = 3, 1.0
_COMMANDS = frozenset(NmtCommand)
_ENDS = ("done", "incomplete", "abort")


@dataclass(slots=True)
class _Commanded:
    """The last two NMT commands to a node (0: all), the time of the last (s), and reversals in a row."""

    last: int = -1
    before: int = -1
    at_s: float = 0.0
    reversals: list[Moment] = field(default_factory=list)


@dataclass(slots=True)
class MasterProblems:
    """Watches for SDO requests within another transfer, and for NMT commands by turns."""

    #: time of the last frame of a running transfer, by server; nodes that answer
    _running: dict[Channel, float] = field(default_factory=dict)
    _present: set[int] = field(default_factory=set)
    _clients: TimesOf[int] = field(default_factory=TimesOf)
    _commanded: dict[int, _Commanded] = field(default_factory=dict)
    _fights: dict[int, Moments] = field(default_factory=dict)

    def start(self, node_id: int) -> None:
        """Node *node_id* starts: its transfers are over."""
        for channel in [channel for channel in self._running if channel[0] == node_id]:
            del self._running[channel]

    def take_sdo(self, moment: Moment, channel: Channel, step: SdoStep, *, request: bool) -> bool:
        """Look at a *step* of a transfer of *channel*; return whether it begins one while another client's runs."""
        node_id = channel[0]
        self._commanded.pop(node_id, None)  # whoever changes a node sets its state before and after that
        self._commanded.pop(0, None)
        if not request:
            self._present.add(node_id)
        is_other = step.step == "start" and moment.time_s - self._running.get(channel, -1e9) < _SAME_CLIENT_S
        if is_other:
            self._clients.note(moment, node_id)
        if step.step in _ENDS:
            self._running.pop(channel, None)
        elif step.step != "unknown":
            self._running[channel] = moment.time_s
        return is_other

    def take_command(self, moment: Moment, data: bytes) -> None:
        """Look at an NMT command."""
        if len(data) != 2 or data[0] not in _COMMANDS:
            return
        commanded = self._commanded.setdefault(data[1], _Commanded())
        if data[0] == commanded.last:
            return
        if data[0] == commanded.before and moment.time_s - commanded.at_s < _REVERSED_S:
            commanded.reversals.append(moment)
            if len(commanded.reversals) >= _REVERSALS:
                self._fights[data[1]] = Moments.at(*commanded.reversals)
        else:
            commanded.reversals = []
        commanded.before, commanded.last, commanded.at_s = commanded.last, data[0], moment.time_s

    def problems(self) -> Iterator[Problem]:
        """Return nodes with two SDO clients, and those with two NMT masters."""
        for node_id, moments in self._clients.items():
            if node_id in self._present:
                text = f"node {node_id}: {plural(moments.times, 'request')} within another transfer"
                yield Problem(TWO_MASTERS, text, f"two SDO clients and node {node_id}",
                              "which programs use the node's SDO at once: each takes the other's answers", moments,
                              node_id)  # fmt: skip
        for node_id, moments in self._fights.items():
            whom = f"node {node_id}" if node_id else "all nodes"
            text = f"{whom}: NMT commands undo each other {plural(moments.times, 'time')} in a row"
            yield Problem(TWO_MASTERS, text, f"NMT masters and {whom}", "which masters are on the bus", moments,
                          node_id or None)  # fmt: skip

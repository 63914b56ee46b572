"""Restarts, heartbeats that stop or are late, and emergencies (CiA 301, 7.2.8 and 7.2.7)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from statistics import median

from dvtcli.domain.emergency_codes import emergency_text
from dvtcli.domain.lint.lint_rule import ERROR, WARNING, LintRule
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.watch.recording.problems import Moment, Moments, Problem, TimesOf

BOOT_UP = LintRule(
    "boot-up-in-operation", ERROR, "a node restarted without an NMT command", "CiA 301, 7.2.8.3.3: boot-up"
)
NO_BOOT_UP = LintRule("no-boot-up", ERROR, "a node did not come back after an NMT reset", "CiA 301, 7.2.8.3.3: boot-up")
STOPS = LintRule("heartbeat-stops", ERROR, "a node's heartbeats end before the recording does", "CiA 301, 7.2.8.3.2.2")
LATE = LintRule("heartbeat-late", WARNING, "a heartbeat came late", "CiA 301, 7.5.2.18: producer heartbeat time")
NOT_RESET = LintRule("emergency-not-reset", ERROR, "an EMCY was sent, and no error reset", "CiA 301, 7.2.7")
RESET = LintRule("emergency-reset", WARNING, "an EMCY was sent, and reset later", "CiA 301, 7.2.7")
SYNC_LATE = LintRule("sync-late", WARNING, "a SYNC message came late", "CiA 301, 7.5.2.6: communication cycle period")
NODE_RULES = (BOOT_UP, NO_BOOT_UP, STOPS, LATE, NOT_RESET, RESET, SYNC_LATE)

_NMT, _EMERGENCIES, _ANSWERS, _REQUESTS, _HEARTBEATS = 0x000, 0x080, 0x580, 0x600, 0x700
_RESETS = (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION)
#: downloads of 0x1017 and 0x1006 begin so behind their command
_HEARTBEAT_TIME, _SYNC_PERIOD = b"\x17\x10\x00", b"\x06\x10\x00"
#: heartbeats from which a period is known, gaps that are kept, and how many periods a heartbeat may take
_ENOUGH, _MOST_GAPS, _PATIENCE = 4, 1_000, 2.5
#: how long a node may be silent after a reset (s)
_BOOT_S = 5.0


@dataclass(slots=True)
class _Heartbeats:
    """Heartbeats of a node, or SYNC, since a start or another period: the last, the gaps (s), and long gaps.

    A long gap has its time (s), the time without any frame before its end (s), and the moment of its end.
    """

    last: Moment | None = None
    gaps_s: list[float] = field(default_factory=list)
    long: list[tuple[float, float, Moment]] = field(default_factory=list)

    def take(self, moment: Moment, silent_s: float) -> None:
        if self.last is not None:
            gap_s = moment.time_s - self.last.time_s
            if len(self.gaps_s) < _MOST_GAPS:
                self.gaps_s.append(gap_s)
            if len(self.gaps_s) <= _ENOUGH or gap_s > _PATIENCE * median(self.gaps_s[:_ENOUGH]):
                self.long.append((gap_s, silent_s, moment))
        self.last = moment

    @property
    def period_s(self) -> float:
        """The usual gap; 0 if it is not known."""
        return median(self.gaps_s) if len(self.gaps_s) >= _ENOUGH else 0.0


@dataclass(slots=True)
class _NodeSeen:
    is_alive: bool = False
    state: NmtState | None = None
    #: resets that were commanded and have no boot-up yet, and the first since which a node that was alive sent nothing
    resets: int = 0
    gone: Moment | None = None
    heartbeats: _Heartbeats = field(default_factory=_Heartbeats)
    is_guarded: bool = False
    emergencies: dict[int, Moments] = field(default_factory=dict)


@dataclass(slots=True)
class NodeProblems:
    """Watches NMT commands, boot-up messages, heartbeats and EMCY messages with their default CAN-IDs."""

    _nodes: dict[int, _NodeSeen] = field(default_factory=dict)
    _boot_ups: TimesOf[tuple[int, NmtState | None]] = field(default_factory=TimesOf)
    _late: list[tuple[int, float, _Heartbeats]] = field(default_factory=list)
    _syncs: list[_Heartbeats] = field(default_factory=lambda: [_Heartbeats()])
    _ended: list[tuple[int, int, Moments]] = field(default_factory=list)

    def take(self, moment: Moment, frame: Frame, before: Moment) -> None:
        """Look at *frame*, of NMT, EMCY, SDO or error control; any frame came *before*."""
        service, node_id, data = frame.can_id & 0x780, frame.can_id & 0x7F, frame.data
        if frame.can_id == _NMT:
            self._command(moment, data)
            return
        if not node_id:
            if service == _EMERGENCIES and not frame.remote:
                self._syncs[-1].take(moment, moment.time_s - before.time_s)
            return
        node = self._nodes.setdefault(node_id, _NodeSeen())
        if service == _HEARTBEATS:
            node.is_guarded = node.is_guarded or frame.remote
            if len(data) == 1 and not frame.remote:
                self._error_control(moment, node_id, node, data[0] & 0x7F, moment.time_s - before.time_s)
        elif service == _EMERGENCIES and len(data) >= 2:
            node.is_alive, node.gone = True, None
            self._emergency(moment, node_id, node, int.from_bytes(data[:2], "little"))
        elif service == _REQUESTS and data[1:4] == _HEARTBEAT_TIME and data[0] >> 5 == 1:
            self._new_period(node_id, node)
        elif service == _REQUESTS and data[1:4] == _SYNC_PERIOD and data[0] >> 5 == 1:
            self._syncs.append(_Heartbeats())
        elif service == _ANSWERS:
            node.is_alive, node.gone = True, None

    def take_pdo(self, node_id: int) -> None:
        """Look at a frame with the default CAN-ID of a TPDO of *node_id*: the node is there."""
        if (node := self._nodes.get(node_id)) is not None:
            node.gone = None

    def _command(self, moment: Moment, data: bytes) -> None:
        if len(data) != 2 or data[0] not in _RESETS:
            return
        for node_id, node in self._nodes.items():
            if data[1] in (0, node_id):
                node.resets += 1
                if node.is_alive and node.gone is None:
                    node.gone = moment
                self._new_period(node_id, node)

    def _new_period(self, node_id: int, node: _NodeSeen) -> None:
        """Judge later heartbeats by themselves: the node starts, or its 0x1017 is written."""
        if (period_s := node.heartbeats.period_s) and not node.is_guarded:
            self._late.append((node_id, period_s, node.heartbeats))
        node.heartbeats = _Heartbeats()

    def _error_control(self, moment: Moment, node_id: int, node: _NodeSeen, state: int, silent_s: float) -> None:
        node.gone = None
        if state != NmtState.INITIALISING:
            node.is_alive = True
            node.state = NmtState(state) if state in set(NmtState) else None
            node.heartbeats.take(moment, silent_s)
            return
        if node.is_alive and not node.resets:
            self._boot_ups.note(moment, (node_id, node.state))
        if not node.resets:
            self._new_period(node_id, node)
        for code, moments in node.emergencies.items():
            self._ended.append((node_id, code, moments))
        node.is_alive, node.resets, node.state, node.emergencies = True, max(0, node.resets - 1), None, {}

    def _emergency(self, moment: Moment, node_id: int, node: _NodeSeen, code: int) -> None:
        if code >> 8 == 0:
            self._ended += [(node_id, active, moments) for active, moments in node.emergencies.items()]
            node.emergencies = {}
        elif code in node.emergencies:
            node.emergencies[code].add(moment)
        else:
            node.emergencies[code] = Moments.at(moment)

    def problems(self, end: Moment) -> Iterator[Problem]:
        """Return restarts, missing and late heartbeats, and emergencies."""
        for (node_id, state), moments in self._boot_ups.items():
            was = f" in {state.label}" if state is not None else ""
            yield _of_node(BOOT_UP, node_id, f"restarted{was} without an NMT command", moments,
                           "its supply, watchdog and firmware; what was not stored in it is lost")  # fmt: skip
        for node_id, node in self._nodes.items():
            if node.gone is not None and (silent_s := end.time_s - node.gone.time_s) > _BOOT_S:
                yield _of_node(NO_BOOT_UP, node_id, f"sends nothing in the {silent_s:.3g} s since an NMT reset",
                               Moments.at(node.gone), "whether the node is on, bus off, or has another node-ID "
                               "or bit rate since")  # fmt: skip
            yield from self._last_heartbeat(node_id, node, end)
        for node_id, period_s, heartbeats in self._late:
            yield from _late(node_id, period_s, heartbeats)
        for syncs in self._syncs:
            yield from _late(0, syncs.period_s, syncs)
        for node_id, node in self._nodes.items():
            for code, moments in node.emergencies.items():
                yield _of_node(NOT_RESET, node_id, f"EMCY 0x{code:04X}, {emergency_text(code)}: not reset", moments,
                               f"the error history (0x1003) of node {node_id}")  # fmt: skip
        for node_id, code, moments in self._ended:
            yield _of_node(RESET, node_id, f"EMCY 0x{code:04X}, {emergency_text(code)}: reset later", moments,
                           "what the machine did at that time")  # fmt: skip

    def _last_heartbeat(self, node_id: int, node: _NodeSeen, end: Moment) -> Iterator[Problem]:
        heartbeats, period_s = node.heartbeats, node.heartbeats.period_s
        if heartbeats.last is None or not period_s or node.is_guarded:
            return
        yield from _late(node_id, period_s, heartbeats)
        silent_s = end.time_s - heartbeats.last.time_s
        if silent_s > _PATIENCE * period_s:
            text = f"sends no heartbeat in the last {silent_s:.3g} s; before, one each {1000 * period_s:.0f} ms"
            yield _of_node(STOPS, node_id, text, Moments.at(heartbeats.last),
                           "whether the node is on, bus off, or was unplugged")  # fmt: skip


def _late(node_id: int, period_s: float, heartbeats: _Heartbeats) -> Iterator[Problem]:
    """Report gaps of more than two and a half periods in which other frames came after the heartbeat was due.

    Node 0: of SYNC.
    """
    late = [
        (gap_s, moment)
        for gap_s, silent_s, moment in heartbeats.long
        if gap_s > _PATIENCE * period_s > 0 and gap_s - silent_s > (_PATIENCE - 1) * period_s
    ]
    if not late:
        return
    worst_s, moments = max(gap_s for gap_s, _ in late), Moments.at(*(moment for _, moment in late))
    text = f"{1000 * worst_s:.0f} ms after the one before it; usual are {1000 * period_s:.0f} ms"
    if node_id:
        look = "the node's load, and that of the bus, at these times"
        yield _of_node(LATE, node_id, f"heartbeat {text}", moments, look)
    else:
        look = "what its producer did, and who else has the bus, at these times"
        yield Problem(SYNC_LATE, f"SYNC {text}", "SYNC producer and all consumers", look, moments)


def _of_node(rule: LintRule, node_id: int, text: str, moments: Moments, look: str) -> Problem:
    return Problem(rule, f"node {node_id}: {text}", f"node {node_id}", look, moments, node_id)

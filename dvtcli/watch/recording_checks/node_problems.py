"""Restarts, heartbeats that stop or are late, and emergencies (CiA 301, 7.2.8 and 7.2.7)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from dvtcli.domain.can_ids import EMCY_BASE, HEARTBEAT_BASE, NMT_ID, SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.domain.emergency_codes import emergency_text
from dvtcli.domain.lint import ERROR, WARNING, LintRule
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.domain.standard_objects import source
from dvtcli.watch.recording_checks.problems import LATE_AFTER_PERIODS, Moment, Moments, PeriodicFrames, Problem, TimesOf

BOOT_UP = LintRule(
    "boot-up-in-operation", ERROR, "a node restarted without an NMT command", "CiA 301, 7.2.8.3.3: boot-up"
)
NO_BOOT_UP = LintRule(
    "no-boot-up", ERROR, "a node did not start again after an NMT reset", "CiA 301, 7.2.8.3.3: boot-up"
)
STOPS = LintRule("heartbeat-stops", ERROR, "a node's heartbeats end before the recording does", "CiA 301, 7.2.8.3.2.2")
LATE = LintRule("heartbeat-late", WARNING, "a heartbeat was late", f"{source(0x1017)}: producer heartbeat time")
NOT_RESET = LintRule("emergency-not-reset", ERROR, "an EMCY was sent, but no error reset", "CiA 301, 7.2.7")
RESET = LintRule("emergency-reset", WARNING, "an EMCY was sent, and reset later", "CiA 301, 7.2.7")
SYNC_LATE = LintRule("sync-late", WARNING, "a SYNC message was late", f"{source(0x1006)}: communication cycle period")
SYNC_JITTER = LintRule("sync-jitter", WARNING, "SYNC comes at uneven times", "CiA 301, 7.2.5 and 7.5.2.6")
TWO_SYNCS = LintRule("two-sync-producers", ERROR, "two nodes seem to send SYNC", "CiA 301, 7.2.5: one producer")
TWO_HEARTBEATS = LintRule(
    "two-heartbeats", ERROR, "heartbeats of one node-ID seem to be from two nodes",
    "CiA 301, 7.3.4: node-IDs are unique",
)  # fmt: skip
NODE_RULES = (
    BOOT_UP, NO_BOOT_UP, STOPS, LATE, NOT_RESET, RESET, SYNC_LATE, SYNC_JITTER, TWO_SYNCS, TWO_HEARTBEATS,
)  # fmt: skip
_STATES = frozenset(NmtState)
_RESETS = (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION)
#: command specifiers of a download, of its acceptance, and the first byte of an abort (CiA 301, 7.2.4.3)
_DOWNLOAD, _DOWNLOADED, _ABORT = 1, 3, 0x80
#: downloads of 0x1017 and 0x1006 begin so behind their command
_HEARTBEAT_TIME, _SYNC_PERIOD = b"\x17\x10\x00", b"\x06\x10\x00"
#: how long a node may be silent after a reset (s)
_BOOT_S = 5.0
#: how long an answer usually takes at most (s): a node that is STOPPED later had the time to answer
_ANSWER_S = 0.1
#: changes to the state before the last, without an NMT command, from which two nodes are likely
_STATE_TURNS = 4


@dataclass(slots=True)
class _NodeSeen:
    is_alive: bool = False
    state: NmtState | None = None
    #: resets that were commanded and have no boot-up yet, and the first since which a node that was alive sent nothing
    resets: int = 0
    gone: Moment | None = None
    heartbeats: PeriodicFrames = field(default_factory=PeriodicFrames)
    is_guarded: bool = False
    #: when it first and last showed that it is OPERATIONAL: by a heartbeat, a TPDO, or any frame after an NMT start
    operational: tuple[Moment, Moment] | None = None
    #: the state before the last one, and returns to it since an NMT command
    state_before: NmtState | None = None
    state_turns: list[Moment] = field(default_factory=list)
    emergencies: dict[int, Moments] = field(default_factory=dict)
    #: its last SDO response
    answered: Moment | None = None
    #: the time since its last heartbeat, if it was asked since
    silence: Silence | None = None
    #: the heartbeats before a write of 0x1017 that has no answer yet
    before_write: PeriodicFrames | None = None


@dataclass(slots=True)
class NodeProblems:
    """Watches NMT commands, boot-up messages, heartbeats and EMCY messages with their default CAN-IDs."""

    _nodes: dict[int, _NodeSeen] = field(default_factory=dict)
    _boot_ups: TimesOf[tuple[int, NmtState | None]] = field(default_factory=TimesOf)
    _late: list[tuple[int, float, PeriodicFrames]] = field(default_factory=list)
    _syncs: list[PeriodicFrames] = field(default_factory=lambda: [PeriodicFrames()])
    _ended: list[tuple[int, int, Moments]] = field(default_factory=list)
    #: by node-ID (0: all other nodes), what showed STOPPED; None for another state
    _stopped: dict[int, Stop | None] = field(default_factory=dict)
    #: by node-ID (0: all other nodes), its last NMT command if that is a start; None for another one
    _started: dict[int, Moment | None] = field(default_factory=dict)
    #: the node with a write of 0x1006 that has no answer yet, 0: none
    _sync_writer: int = 0

    def take(self, moment: Moment, frame: Frame, before: Moment) -> None:
        """Look at *frame*, of NMT, EMCY, SDO or error control; any frame came *before*."""
        service, node_id, data = frame.can_id & 0x780, frame.can_id & 0x7F, frame.data
        if frame.can_id == NMT_ID:
            self._command(moment, data)
            return
        if not node_id:
            if service == EMCY_BASE and not frame.remote:
                self._syncs[-1].take(moment, moment.time_s - before.time_s)
            return
        node = self._nodes.setdefault(node_id, _NodeSeen())
        if service == HEARTBEAT_BASE:
            node.is_guarded = node.is_guarded or frame.remote
            if len(data) == 1 and not frame.remote:
                self._error_control(moment, node_id, node, data[0] & 0x7F, moment.time_s - before.time_s)
        elif service == EMCY_BASE and len(data) >= 2:
            node.is_alive, node.gone = True, None
            self._shows_start(moment, node_id, node)
            self._emergency(moment, node_id, node, int.from_bytes(data[:2], "little"))
        elif service in (SDO_REQUEST_BASE, SDO_RESPONSE_BASE):
            if data[1:4] in (_HEARTBEAT_TIME, _SYNC_PERIOD):
                self._write_of_period(moment, node_id, node, data, is_request=service == SDO_REQUEST_BASE)
            if service == SDO_RESPONSE_BASE:
                self._answer(moment, node_id, node)

    def _write_of_period(self, moment: Moment, node_id: int, node: _NodeSeen, data: bytes, *, is_request: bool) -> None:
        """Take a frame about 0x1017 or 0x1006: a write begins a new period; an abort of it returns to the old one.

        A write without an answer in the recording counts as accepted.
        """
        is_heartbeat, command = data[1:4] == _HEARTBEAT_TIME, data[0] >> 5
        if is_request and command == _DOWNLOAD:
            before = node.heartbeats
            if is_heartbeat:
                self._new_period(moment, node_id, node)
                node.before_write = before
            else:
                self._syncs.append(PeriodicFrames())
                self._sync_writer = node_id
            return
        is_refused = data[0] == _ABORT
        if not is_refused and (is_request or command != _DOWNLOADED):
            return
        if is_heartbeat:
            if is_refused and node.before_write is not None:
                node.heartbeats = node.before_write
                self._late = [entry for entry in self._late if entry[2] is not node.heartbeats]
            node.before_write = None
        elif self._sync_writer == node_id:
            if is_refused:
                self._syncs.pop()
            self._sync_writer = 0

    def _stop(self, node_id: int) -> Stop | None:
        """What showed that node *node_id* is STOPPED now; None if it is not known to be."""
        return self._stopped.get(node_id, self._stopped.get(0))

    def asked(self, node_id: int, moment: Moment) -> NodeAtRequest:
        """Return the state of node *node_id* at a request at *moment*."""
        node = self._nodes.get(node_id)
        if node is None or (last := node.heartbeats.last) is None:
            return NodeAtRequest(node_id, moment, self._stop(node_id), None)
        if node.silence is None:
            node.silence = Silence(last, node.heartbeats, node.answered is not None and node.answered > last)
        return NodeAtRequest(node_id, moment, self._stop(node_id), node.silence)

    def cause(self, asked: NodeAtRequest) -> Cause:
        """Return what may explain that the request *asked* has no answer by now.

        A later stop does so only if the node had no time to answer before.
        """
        stop, node = asked.stop or self._stop(asked.node_id), self._nodes.get(asked.node_id)
        if stop is not None and stop.moment.time_s - asked.moment.time_s > _ANSWER_S:
            stop = None
        return Cause(stop, None if node is None or node.is_guarded else asked.silence)

    def operational(self, node_id: int) -> tuple[Moment, Moment] | None:
        """When node *node_id* first and last showed that it is OPERATIONAL."""
        return self._nodes[node_id].operational if node_id in self._nodes else None

    def take_pdo(self, moment: Moment, node_id: int) -> None:
        """Look at a frame of a TPDO of *node_id*: the node is there, and OPERATIONAL."""
        node = self._nodes.setdefault(node_id, _NodeSeen())
        node.gone = None
        begin = self._start(node_id) or moment
        node.operational = (node.operational or (begin,))[0], moment

    def _start(self, node_id: int) -> Moment | None:
        """The NMT start of node *node_id*, None if another command or a boot-up came behind it."""
        return self._started.get(node_id, self._started.get(0))

    def _shows_start(self, moment: Moment, node_id: int, node: _NodeSeen) -> None:
        """Take a frame of *node* at *moment* as a sign of OPERATIONAL if it was started, and no heartbeat denies it."""
        begin = self._start(node_id)
        if begin is not None and node.state in (None, NmtState.OPERATIONAL):
            node.operational = (node.operational or (begin,))[0], moment

    def _answer(self, moment: Moment, node_id: int, node: _NodeSeen) -> None:
        node.is_alive, node.gone, node.answered = True, None, moment
        self._shows_start(moment, node_id, node)
        self._stopped[node_id] = None
        if node.silence is not None:
            node.silence.is_answered = True

    def _command(self, moment: Moment, data: bytes) -> None:
        if len(data) != 2:
            return
        if not data[1]:
            self._stopped.clear()
            self._started.clear()
        self._started[data[1]] = moment if data[0] == NmtCommand.START else None
        self._stopped[data[1]] = Stop("the NMT stop", moment) if data[0] == NmtCommand.STOP else None
        for node_id, node in self._nodes.items():
            if data[1] in (0, node_id):
                node.state_before = None
                if data[0] in _RESETS:
                    self._reset(moment, node_id, node)

    def _reset(self, moment: Moment, node_id: int, node: _NodeSeen) -> None:
        node.resets += 1
        if node.is_alive and node.gone is None:
            node.gone = moment
        self._new_period(moment, node_id, node)

    def _new_period(self, moment: Moment, node_id: int, node: _NodeSeen) -> None:
        """Judge later heartbeats by themselves: the node starts, or its 0x1017 is written."""
        if (period_s := node.heartbeats.period_s) and not node.is_guarded:
            self._late.append((node_id, period_s, node.heartbeats))
        node.heartbeats, node.before_write = PeriodicFrames(), None
        _end_silence(moment, node)

    def _error_control(self, moment: Moment, node_id: int, node: _NodeSeen, state: int, silent_s: float) -> None:
        node.gone = None
        if state != NmtState.STOPPED:
            self._stopped[node_id] = None
        elif self._stop(node_id) is None:
            self._stopped[node_id] = Stop("the heartbeat", moment)
        if state != NmtState.INITIALISING:
            node.is_alive = True
            node.heartbeats.take(moment, silent_s)
            _end_silence(moment, node)
            if state != node.state:
                _change(moment, node, NmtState(state) if state in _STATES else None)
            if state == NmtState.OPERATIONAL:
                node.operational = (node.operational or (moment,))[0], moment
            return
        self._started[node_id] = None
        if node.is_alive and not node.resets:
            self._boot_ups.note(moment, (node_id, node.state))
        if not node.resets:
            self._new_period(moment, node_id, node)
        for code, moments in node.emergencies.items():
            self._ended.append((node_id, code, moments))
        node.is_alive, node.resets, node.emergencies = True, max(0, node.resets - 1), {}
        node.state = node.state_before = None

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
                           "its supply, watchdog and firmware; its unstored values are lost")  # fmt: skip
        for node_id, node in self._nodes.items():
            if node.gone is not None and (silent_s := end.time_s - node.gone.time_s) > _BOOT_S:
                yield _of_node(NO_BOOT_UP, node_id, f"sends nothing in the {silent_s:.3g} s since an NMT reset",
                               Moments.at(node.gone), "whether the node is on, bus off, or has another node-ID "
                               "or bit rate since")  # fmt: skip
            yield from self._last_heartbeat(node_id, node, end)
        for node_id, period_s, heartbeats in self._late:
            yield from _late(node_id, period_s, heartbeats)
        for syncs in self._syncs:
            yield from _of_syncs(syncs)
        for node_id, node in self._nodes.items():
            for code, moments in node.emergencies.items():
                yield _of_node(NOT_RESET, node_id, f"EMCY 0x{code:04X}, {emergency_text(code)}: not reset", moments,
                               f"the error history (0x1003) of node {node_id}")  # fmt: skip
        for node_id, code, moments in self._ended:
            yield _of_node(RESET, node_id, f"EMCY 0x{code:04X}, {emergency_text(code)}: reset later", moments,
                           "the state of the machine at that time")  # fmt: skip

    def _last_heartbeat(self, node_id: int, node: _NodeSeen, end: Moment) -> Iterator[Problem]:
        heartbeats, period_s = node.heartbeats, node.heartbeats.period_s
        if heartbeats.last is None or not period_s or node.is_guarded:
            return
        yield from _of_two(node_id, node)
        yield from _late(node_id, period_s, heartbeats)
        silent_s = end.time_s - heartbeats.last.time_s
        if silent_s > LATE_AFTER_PERIODS * period_s:
            text = f"sends no heartbeat in the last {silent_s:.3g} s; before, its period was {1000 * period_s:.0f} ms"
            yield _of_node(STOPS, node_id, text, Moments.at(heartbeats.last),
                           "whether the node is on, bus off, or was unplugged")  # fmt: skip


def _end_silence(moment: Moment, node: _NodeSeen) -> None:
    """Note that the time without a heartbeat of *node* ended at *moment*."""
    if node.silence is not None:
        node.silence.end, node.silence = moment, None


def _change(moment: Moment, node: _NodeSeen, state: NmtState | None) -> None:
    """Note another state of *node*, and whether it is the one before the last, without an NMT command."""
    if state is not None and state is node.state_before:
        node.state_turns.append(moment)
    node.state_before, node.state = node.state, state


def _of_two(node_id: int, node: _NodeSeen) -> Iterator[Problem]:
    """Report heartbeats that no single node sends: short and long gaps, or two states, by turns."""
    times, how = node.heartbeats.turns.times, "come at alternately short and long intervals"
    if len(node.state_turns) >= _STATE_TURNS:
        times, how = Moments.at(*node.state_turns), "name two states by turns, without an NMT command"
    if times is not None:
        look = f"the serial numbers (0x1018:04) of the nodes with node-ID {node_id}, one of them unplugged"
        yield Problem(TWO_HEARTBEATS, f"node {node_id}: its heartbeats {how}", f"nodes with node-ID {node_id}", look,
                      times, node_id)  # fmt: skip


def _late(node_id: int, period_s: float, heartbeats: PeriodicFrames) -> Iterator[Problem]:
    """Report gaps of more than two and a half periods in which other frames came after the heartbeat was due."""
    if late := heartbeats.late():
        worst_s, moments = max(gap_s for gap_s, _ in late), Moments.at(*(moment for _, moment in late))
        text = f"heartbeat {1000 * worst_s:.0f} ms after the one before; usual: {1000 * period_s:.0f} ms"
        look = "the node's load, and that of the bus, at these times"
        yield _of_node(LATE, node_id, text, moments, look)


def _of_syncs(syncs: PeriodicFrames) -> Iterator[Problem]:
    """Report late SYNC messages, uneven ones, and those of two producers."""
    period, parties = f"usual: {1000 * syncs.period_s:.3g} ms", "SYNC producer and all consumers"
    if late := syncs.late():
        text = f"SYNC {1000 * max(gap_s for gap_s, _ in late):.3g} ms after the one before; {period}"
        look = "the state of its producer and the other traffic at these times"
        yield Problem(SYNC_LATE, text, parties, look, Moments.at(*(moment for _, moment in late)))
    if syncs.turns.times is not None:
        yield Problem(TWO_SYNCS, "SYNC comes at alternately short and long intervals", "SYNC producers",
                      "in which nodes bit 30 of 0x1005 is set, and whether a master sends SYNC, too",
                      syncs.turns.times)  # fmt: skip
    elif uneven := syncs.jitter():
        gaps_s = [gap_s for gap_s, _ in uneven]
        text = f"SYNC {1000 * min(gaps_s):.3g} to {1000 * max(gaps_s):.3g} ms after the one before; {period}"
        look = "whether its producer sends it from its own task, and which CAN-IDs have a higher priority"
        yield Problem(SYNC_JITTER, text, parties, look, Moments.at(*(moment for _, moment in uneven)))


def _of_node(rule: LintRule, node_id: int, text: str, moments: Moments, look: str) -> Problem:
    return Problem(rule, f"node {node_id}: {text}", f"node {node_id}", look, moments, node_id)


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

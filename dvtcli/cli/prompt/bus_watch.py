"""Read the bus while the prompt waits: states, heartbeats, boot-ups, emergencies; few messages a second."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from json import dumps
from time import monotonic, time
from typing import TYPE_CHECKING

from dvtcli.bus.receiver import bus_closed
from dvtcli.domain.can_ids import HEARTBEAT_BASE
from dvtcli.domain.emergency_codes import emergency_text
from dvtcli.domain.network.received_traffic import LastFrames
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import BootUp, Emergency, Frame, NodeEvent
from dvtcli.domain.text import some_nodes
from dvtcli.domain.times import local_clock
from dvtcli.errors import BusUnavailable
from dvtcli.operations.results.frames import BusEvent
from dvtcli.operations.session.steady_listener import Sleeps, come_back, goes_on, left_alone
from dvtcli.watch.heartbeats import Heartbeats
from dvtcli.watch.statistics import BusLoad

if TYPE_CHECKING:
    from dvtcli.operations.session.session import Session

#: Maximum number of messages per node, and their time span (s); the outcome is reported afterwards.
MOST, WITHIN_S = 2, 10.0


class Silences:
    """The nodes with reported heartbeat loss."""

    def __init__(self) -> None:
        self._missing: set[int] = set()
        self._told_s: dict[int, deque[float]] = {}

    def heard_of(self, silences: Mapping[int, tuple[float, bool]], now_s: float) -> list[str]:
        """Return news at *now_s* from *silences*: by node-ID the age (s) of the last heartbeat, and if overdue."""
        news = [
            node_id
            for node_id, (_, overdue) in silences.items()
            if overdue != (node_id in self._missing) and self._may_tell(node_id, now_s)
        ]
        gone = [node_id for node_id in news if silences[node_id][1]]
        back = [node_id for node_id in news if not silences[node_id][1]]
        self._missing |= set(gone)
        self._missing -= set(back)
        return [*_gone(gone, silences), *_back(back)]

    def started(self, node_id: int) -> None:
        """End the silence of a restarted node."""
        self._missing.discard(node_id)

    def _may_tell(self, node_id: int, now_s: float) -> bool:
        told_s = self._told_s.setdefault(node_id, deque(maxlen=MOST))
        if len(told_s) == MOST and now_s - told_s[0] < WITHIN_S:
            return False
        told_s.append(now_s)
        return True


def _gone(node_ids: list[int], silences: Mapping[int, tuple[float, bool]]) -> list[str]:
    if not node_ids:
        return []
    ages_s = sorted(silences[node_id][0] for node_id in node_ids)
    if len(node_ids) == 1:
        return [f"node {node_ids[0]}  heartbeat lost: the last was received {ages_s[0]:.1f} s ago"]
    which, ages = some_nodes(sorted(node_ids)), f"{ages_s[0]:.1f} to {ages_s[-1]:.1f} s ago"
    return [f"{which}  heartbeats lost: the last were received {ages}"]


def _back(node_ids: list[int]) -> list[str]:
    if not node_ids:
        return []
    returned = "heartbeat is back" if len(node_ids) == 1 else "heartbeats are back"
    return [f"{some_nodes(sorted(node_ids))}  {returned}"]


def event_text(event: NodeEvent) -> str:
    """Return an event on one line."""
    if isinstance(event, BootUp):
        return f"node {event.node_id}  boot-up: it has started"
    if isinstance(event, Emergency):
        maker = event.manufacturer.hex(" ").upper()
        text = f"0x{event.code:04X} {emergency_text(event.code)}"
        return f"node {event.node_id}  EMCY {text}  register 0x{event.register:02X}  {maker}"
    return f"node {event.node_id}  is {event.after.label}"


#: Duration of a read (s): the maximum delay of messages, and of stopping.
TICK_S = 0.1


class Life:
    """Watches the bus of *session*; events become *notices*.

    The load is available if the bit rate is known.
    """

    def __init__(self, session: Session, notices: Notices) -> None:
        self._session = session
        self._bus = session.wire
        self.notices = notices
        #: held while a line runs: the bus is replaced between lines
        self.line = threading.RLock()
        self._sleeps = Sleeps()
        self.states: dict[int, NmtState] = {}
        self.emergencies: dict[int, tuple[int, int]] = {}
        #: the failure of the bus, None if healthy
        self.failure: str | None = None
        self._heartbeats = Heartbeats()
        self._silences = Silences()
        #: the last frame of each CAN-ID, at times of time.monotonic
        self.frames = LastFrames()
        self._load = self._empty_load()
        self._seen: set[int] = set()
        self._booted: set[int] = set()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="listening", daemon=True)
        self._unhook: list[Callable[[], None]] = []

    def start(self) -> None:
        """Read the bus until `stop`; earlier states count as known and are not reported."""
        self._hook()
        self._thread.start()

    def _hook(self) -> None:
        self.states = self._bus.nodes_seen()
        self._seen.update(self.states)
        self._unhook = [self._bus.on_event(self._on_event), self._bus.tap(self._on_frame)]

    def _empty_load(self) -> BusLoad | None:
        bus = self._bus
        return None if bus.bitrate is None or bus.simulated else BusLoad(bus.bitrate)

    def stop(self) -> None:
        """Stop reading."""
        self._stopping.set()
        self._thread.join(1.0)
        for unhook in self._unhook:
            unhook()
        self._unhook = []

    def silence_s(self, node_id: int) -> tuple[float, bool] | None:
        """Return seconds since the last heartbeat, and if the next is overdue; None if the node sends none."""
        return self._heartbeats.silence_s(node_id, monotonic())

    def load(self) -> float | None:
        """Return the bus load of the last second, 0..1; None if the bit rate is unknown."""
        return None if self._load is None else self._load.share(monotonic())

    def _listen(self) -> None:
        while not self._stopping.is_set():
            try:
                self._hear()
            except BusUnavailable as failed:
                if self._stopping.is_set():
                    return
                if not goes_on(self._session, unasked=True):
                    self._give_up(failed)
                    return
                with suppress(BusUnavailable):  # it is gone again, or nobody listens any more
                    self._come_back(failed)

    def _hear(self) -> None:
        """Read the bus briefly, and report news. Raises BusUnavailable if the bus failed or this host slept."""
        self._bus.idle(TICK_S)
        self.failure = None
        slept_s = self._sleeps.new_s()
        if slept_s and goes_on(self._session, unasked=True):
            raise left_alone(self._bus.name, slept_s)
        self.states = self._bus.nodes_seen()
        self._tell_silence()
        self.notices.pump()

    def _give_up(self, failed: BusUnavailable) -> None:
        self.failure = "FAILED"
        self.notices.add(f"{failed.text}: no more frames are received; leave and start again when the bus is back")
        self.notices.pump()

    def _come_back(self, failed: BusUnavailable) -> None:
        """Wait for the *failed* bus, then resume with all state reset."""
        self.failure = "GONE"
        self.states, self._heartbeats = {}, Heartbeats()
        if not come_back(self._session, self._bus, failed, self._is_stopping, self._tell_event, self._between_lines):
            return
        self._bus = self._session.wire
        self.emergencies, self._silences, self._seen, self._booted = {}, Silences(), set(), set()
        self.frames.clear()
        self._load = self._empty_load()
        self._hook()
        self.notices.pump()

    def _is_stopping(self) -> bool:
        """Whether to stop waiting; also outputs pending notices."""
        self.notices.pump()
        return self._stopping.is_set()

    def _tell_event(self, event: BusEvent) -> None:
        forgotten = "" if event.after_s is None else "; values read from its nodes are discarded"
        self.notices.add(dumps(event.document()) if self._session.base.json else f"{event.text}{forgotten}")
        self.notices.pump()

    @contextmanager
    def _between_lines(self) -> Iterator[None]:
        """Wait until no line runs, then block lines meanwhile. Raises an error on `stop`."""
        while not self.line.acquire(timeout=TICK_S):
            if self._is_stopping():
                break
        else:
            try:
                yield
            finally:
                self.line.release()
            return
        raise bus_closed()

    def _tell_silence(self) -> None:
        """Report missing and restored heartbeats."""
        found = {node_id: self.silence_s(node_id) for node_id in self._heartbeats.node_ids}
        silences = {node_id: silence for node_id, silence in found.items() if silence is not None}
        for text in self._silences.heard_of(silences, monotonic()):
            self._say(text)

    def _say(self, text: str) -> None:
        self.notices.add(f"{local_clock(time())}  {text}")

    def _on_frame(self, frame: Frame, sent: bool) -> None:
        """Count bits, keep the frame and time heartbeats; must be fast, being called for every frame."""
        now_s = monotonic()
        if self._load is not None:
            self._load.add(frame, now_s)
        self.frames.take(frame, now_s)
        if not sent or frame.can_id & ~0x7F != HEARTBEAT_BASE:  # one that we send is not a node's
            self._heartbeats.take(frame, now_s)

    def _on_event(self, event: NodeEvent) -> None:
        node_id = event.node_id
        told = isinstance(event, BootUp | Emergency) or self._is_news(node_id)
        if isinstance(event, BootUp):
            self._booted.add(node_id)
            self._silences.started(node_id)
        elif isinstance(event, Emergency):
            count, _ = self.emergencies.get(node_id, (0, 0))
            self.emergencies[node_id] = count + 1, event.code
        self._seen.add(node_id)
        if told:
            self._say(event_text(event))

    def _is_news(self, node_id: int) -> bool:
        """Whether to report a change of state: not on a node's first frame, nor directly after its boot-up."""
        after_boot_up = node_id in self._booted
        self._booted.discard(node_id)
        return node_id in self._seen and not after_boot_up


Show = Callable[[str], None]
#: Messages shown in a second; a person reads no more, and a prompt that scrolls away cannot be typed at.
A_SECOND = 10


class Notices:
    """Keeps messages until they may be shown; `add` may be called by any thread and never waits for the terminal."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        #: held briefly, never while waiting for the terminal
        self._counting = threading.Lock()
        self._waiting: deque[str] = deque(maxlen=A_SECOND)
        self._show: Show | None = None
        self._second = 0.0
        self._shown = 0
        self._withheld = 0

    def add(self, text: str) -> None:
        """Take a message; while more than `A_SECOND` wait, the later ones are only counted."""
        with self._counting:
            if len(self._waiting) < A_SECOND:
                self._waiting.append(text)
            else:
                self._withheld += 1

    @contextmanager
    def shown_by(self, show: Show) -> Iterator[None]:
        """While the block runs, `pump` passes messages to *show*."""
        with self._lock:
            self._show = show
        try:
            yield
        finally:
            with self._lock:
                self._show = None

    def pump(self) -> None:
        """Show what waits and may be shown now; to be called a few times a second."""
        with self._lock:
            if self._show is None:
                return
            if monotonic() - self._second >= 1:
                self._tell_withheld(self._show)
                self._second, self._shown = monotonic(), 0
            while self._waiting and self._shown < A_SECOND:
                self._show(self._waiting.popleft())
                self._shown += 1

    def _tell_withheld(self, show: Show) -> None:
        with self._counting:  # what comes while this is shown belongs to the next count
            withheld, self._withheld = self._withheld, 0
        if withheld:
            show(f"{withheld} more messages of nodes are not shown")

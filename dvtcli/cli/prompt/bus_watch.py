"""Listening to the bus while a person sits at the prompt: states, heartbeats, boot-ups, emergencies.

One daemon thread that gives way to whoever waits for an answer. Does not know the terminal.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic, strftime

from dvtcli.bus.node_watch import HEARTBEAT
from dvtcli.cli.prompt.events import event_text
from dvtcli.cli.prompt.load import BusLoad
from dvtcli.cli.prompt.notices import Notices
from dvtcli.domain.heard import LastFrames
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.node_events import BootUp, Emergency, NodeEvent
from dvtcli.domain.ports import CanopenBus, Frame
from dvtcli.errors import BusUnavailable

#: How long the bus is read in one go (s): how late a message is shown, and how long stopping takes.
TICK_S = 0.1
#: A heartbeat is missing after this many of the node's own periods and this much time (s) more.
PERIODS, GRACE_S = 2, 0.5


@dataclass(slots=True)
class Beat:
    """A node's heartbeat: when the last one came and how long it took since the one before (s, monotonic)."""

    last_s: float
    period_s: float | None = None


class Life:
    """What is heard on *bus*; events become *notices*. its bit rate, where it is known, gives the load."""

    def __init__(self, bus: CanopenBus, notices: Notices) -> None:
        self._bus = bus
        self.notices = notices
        self.states: dict[int, NmtState] = {}
        self.emergencies: dict[int, tuple[int, int]] = {}
        #: what ended the listening, None while all is well
        self.failure: str | None = None
        self._beats: dict[int, Beat] = {}
        #: nodes whose heartbeat was said to be missing
        self._missing: set[int] = set()
        #: the last frame of each CAN-ID, at times of time.monotonic
        self.frames = LastFrames()
        self._load = None if bus.bitrate is None or bus.simulated else BusLoad(bus.bitrate)
        self._seen: set[int] = set()
        self._booted: set[int] = set()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="listening", daemon=True)
        self._unhook: list[Callable[[], None]] = []

    def start(self) -> None:
        """Listen until `stop`; what was on the bus before is taken as known and not told."""
        self.states = self._bus.heard_nodes()
        self._seen.update(self.states)
        self._unhook = [self._bus.on_event(self._on_event), self._bus.tap(self._on_frame)]
        self._thread.start()

    def stop(self) -> None:
        """End the listening."""
        self._stopping.set()
        self._thread.join(1.0)
        for unhook in self._unhook:
            unhook()
        self._unhook = []

    def silence_s(self, node_id: int) -> tuple[float, bool] | None:
        """Seconds since the last heartbeat and whether the next one is overdue; None where the node sends none."""
        beat = self._beats.get(node_id)
        if beat is None or beat.period_s is None:
            return None
        age_s = monotonic() - beat.last_s
        return age_s, age_s > PERIODS * beat.period_s + GRACE_S

    def load(self) -> float | None:
        """The share of the bit rate that the frames of the last second took, 0..1; None where the rate is not known."""
        return None if self._load is None else self._load.share(monotonic())

    def _listen(self) -> None:
        try:
            while not self._stopping.is_set():
                self._bus.idle(TICK_S)
                self.states = self._bus.heard_nodes()
                self._tell_silence()
                self.notices.pump()
        except BusUnavailable as failed:
            if not self._stopping.is_set():
                self.failure = failed.text
                self.notices.add(f"{failed.text}: nothing is heard any more; leave, and start again once it is back")
                self.notices.pump()

    def _tell_silence(self) -> None:
        """Say once that a heartbeat is missing, and once that it is back."""
        for node_id in tuple(self._beats):
            silence = self.silence_s(node_id)
            overdue = silence is not None and silence[1]
            if silence is None or overdue == (node_id in self._missing):
                continue
            if overdue:
                self._missing.add(node_id)
                self._say(f"node {node_id}  no heartbeat any more: the last one came {silence[0]:.1f} s ago")
            else:
                self._missing.discard(node_id)
                self._say(f"node {node_id}  heartbeat is back")

    def _say(self, text: str) -> None:
        self.notices.add(f"{strftime('%H:%M:%S')}  {text}")

    def _on_frame(self, frame: Frame, sent: bool) -> None:
        """Count bits, keep the frame and time heartbeats; called with every frame, so it must be quick."""
        now_s = monotonic()
        if self._load is not None:
            self._load.add(frame, now_s)
        self.frames.take(frame, now_s)
        if sent or frame.extended or frame.can_id & ~0x7F != HEARTBEAT or len(frame.data) != 1 or not frame.data[0]:
            return
        node_id = frame.can_id & 0x7F
        known = self._beats.get(node_id)
        self._beats[node_id] = Beat(now_s, None if known is None else now_s - known.last_s)

    def _on_event(self, event: NodeEvent) -> None:
        node_id = event.node_id
        told = isinstance(event, BootUp | Emergency) or self._is_news(node_id)
        if isinstance(event, BootUp):
            self._booted.add(node_id)
            self._beats.pop(node_id, None)
            self._missing.discard(node_id)
        elif isinstance(event, Emergency):
            count, _ = self.emergencies.get(node_id, (0, 0))
            self.emergencies[node_id] = count + 1, event.code
        self._seen.add(node_id)
        if told:
            self._say(event_text(event))

    def _is_news(self, node_id: int) -> bool:
        """Whether a change of state is worth a line: not a node's first sign of life, nor what a boot-up said."""
        after_boot_up = node_id in self._booted
        self._booted.discard(node_id)
        return node_id in self._seen and not after_boot_up

"""All traffic seen on the bus: a row for each frame, its signals' histories, and the events. Pure."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from dvtcli.domain.abort import Abort
from dvtcli.domain.can_ids import HEARTBEAT_BASE
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import Frame
from dvtcli.watch.decoder import Address, Decoder, Layout, guess, misfit
from dvtcli.watch.frame_reader import OTHER, Reading
from dvtcli.watch.heartbeats import HeartbeatTimes
from dvtcli.watch.service import Service
from dvtcli.watch.statistics import BusLoad, FrameIntervals, ValueHistory

#: answers to a client that asks whether a node has an object
_ABSENT = frozenset({Abort.NO_OBJECT, Abort.NO_SUB_INDEX})
#: maximum number of kept events
EVENTS = 100
#: maximum number of rows; further CAN-IDs are only counted (29 bits make half a billion)
ROWS = 1024
#: explanation of an empty screen: PDOs are sent in OPERATIONAL only (CiA 301, 7.3.2.2)
_WITHOUT_PDOS = dict.fromkeys((NmtState.PRE_OPERATIONAL, NmtState.STOPPED), ": no PDOs until NMT start")
_BY_LABEL = {state.label: state for state in NmtState}


@dataclass(frozen=True, slots=True)
class Event:
    """An event worth a line: an emergency, an NMT command, a change of state."""

    time_s: float
    text: str
    bad: bool = False


@dataclass(slots=True)
class SeenFrame:
    """An address's last frame, frame count, and the time of each byte's last change."""

    layout: Layout
    can_id: int
    extended: bool
    data: bytes = b""
    remote: bool = False
    count: int = 0
    #: time of the last frame (s since 1970)
    last_s: float = 0.0
    rhythm: FrameIntervals = field(default_factory=FrameIntervals)
    changed_s: list[float] = field(default_factory=list)
    histories: list[ValueHistory] = field(default_factory=list)
    #: whether a wrong length, and a guessed layout, were reported
    is_misfit: bool = False
    is_guess: bool = False
    #: what the last frame says
    reading: Reading = OTHER

    @property
    def service(self) -> Service:
        """The frame's service."""
        return self.layout.service


class FrameStore:
    """Takes every frame; *decoder* gives its contents, *bitrate* (bit/s) is the bus's, None if unknown."""

    def __init__(self, decoder: Decoder, bitrate: int | None = None) -> None:
        self.decoder = decoder
        self.load = BusLoad(bitrate)
        self._bitrate = bitrate
        self._heartbeat_times = HeartbeatTimes()
        self.rows: dict[Address, SeenFrame] = {}
        self.events: deque[Event] = deque(maxlen=EVENTS)
        self.states: dict[int, NmtState] = {}
        #: the state in each node's last heartbeat or boot-up
        self._received: dict[int, NmtState] = {}
        self.frames = 0
        #: frames of CAN-IDs beyond the first ROWS
        self.unlisted = 0

    def take(self, frame: Frame, reading: Reading = OTHER) -> bool:
        """Process *frame* with its time `timestamp_s`; whether it has any news. Events come from its *reading*."""
        self.frames += 1
        self.load.add(frame, frame.timestamp_s)
        self._follow_heartbeat_time(frame)
        row = self._row(frame)
        if row is None:
            self.unlisted += 1
            return False
        time_s = frame.timestamp_s
        row.count += 1
        row.last_s = time_s
        row.reading = reading
        row.rhythm.beat(time_s)
        news = self._note_events(frame, row.service, reading)
        first, row.remote = row.count == 1, frame.remote
        if first or len(frame.data) != len(row.data):
            news |= self._note_doubts(row, frame)
        if frame.remote:
            return first or news
        changed = self._note_bytes(row, frame.data, time_s)
        if first or changed:
            for history, value in zip(row.histories, row.layout.read(frame.data), strict=True):
                if value is not None:
                    history.take(value, time_s)
        else:
            for history in row.histories:
                if history.last is not None:
                    history.take(history.last, time_s)
        return first or changed or news

    def _follow_heartbeat_time(self, frame: Frame) -> None:
        """Forget a heartbeat's period if *frame* acknowledges another value of 0x1017."""
        received = self._heartbeat_times.take(frame)
        if received is None or not received.written:
            return
        row = self.rows.get((HEARTBEAT_BASE + received.node_id, False))
        if row is not None:
            row.rhythm = FrameIntervals()

    def _row(self, frame: Frame) -> SeenFrame | None:
        address = frame.can_id, frame.extended
        row = self.rows.get(address)
        if row is None and len(self.rows) < ROWS:
            layout = self.decoder.layout(frame)
            row = SeenFrame(layout, frame.can_id, frame.extended, histories=[ValueHistory() for _ in layout.signals])
            self.rows[address] = row
        return row

    def _note_doubts(self, row: SeenFrame, frame: Frame) -> bool:
        """Add an event if *frame* does not fit the row's layout, or if the layout is a guess; whether it was new."""
        guessed = "" if row.is_guess else guess(frame, row.layout)
        wrong = "" if row.is_misfit else misfit(frame, row.layout)
        row.is_guess, row.is_misfit = row.is_guess or bool(guessed), row.is_misfit or bool(wrong)
        for text in (guessed, wrong):
            if text:
                self.events.append(Event(frame.timestamp_s, text, bad=True))
        return bool(guessed or wrong)

    def _note_bytes(self, row: SeenFrame, data: bytes, time_s: float) -> bool:
        """Note changed bytes; whether *data* differs from the row's."""
        if data == row.data:
            return False
        before, row.data = row.data, data
        never = float("-inf")
        if row.count == 1:
            row.changed_s = [never] * len(data)
            return True
        times = row.changed_s + [never] * (len(data) - len(row.changed_s))
        row.changed_s = [
            old_s if at < len(before) and before[at] == byte else time_s
            for at, (byte, old_s) in enumerate(zip(data, times, strict=False))
        ]
        return True

    def _note_events(self, frame: Frame, service: Service, reading: Reading) -> bool:
        if reading.what == "sdo-abort":
            # dvtcli itself asks for optional objects
            if reading.facts.get("transfer") != "write" and reading.facts.get("abort_code") in _ABSENT:
                return False
            self.events.append(Event(frame.timestamp_s, f"SDO node {service.node}  {reading.text}", bad=True))
            return True
        if service.kind == "emcy" and "code" in reading.facts:
            text = f"EMCY node {service.node}  {reading.text.removeprefix('EMCY ')}"
            self.events.append(Event(frame.timestamp_s, text, bad=bool(reading.facts["code"])))
            return True
        if service.kind == "nmt" and "command" in reading.facts:
            self.events.append(Event(frame.timestamp_s, reading.text))
            return True
        return service.kind == "heartbeat" and self._note_state(frame, service.node, reading)

    def _note_state(self, frame: Frame, node_id: int | None, reading: Reading) -> bool:
        """Add an event for a boot-up, and for a heartbeat with another state than the last one; whether there is any.

        After its boot-up a node is in PRE-OPERATIONAL (CiA 301, 7.2.8.3.3).
        """
        state = _BY_LABEL.get(str(reading.facts.get("state")))
        if state is None or node_id is None or len(frame.data) != 1:
            return False
        is_boot_up = reading.what == "boot-up"
        before, self._received[node_id] = self._received.get(node_id), state
        self.states[node_id] = NmtState.PRE_OPERATIONAL if is_boot_up else state
        if before is state and not is_boot_up:
            return False
        said = "boot-up" if is_boot_up else f"is {state.label}{_WITHOUT_PDOS.get(state, '')}"
        self.events.append(Event(frame.timestamp_s, f"node {node_id}  {said}"))
        return True

    def know(self, decoder: Decoder) -> None:
        """Use *decoder* from now on, also for earlier frames: counts stay, values are decoded again."""
        self.decoder = decoder
        for row in self.rows.values():
            layout = decoder.layout(Frame(row.can_id, row.data, row.extended))
            if layout.service == row.service and layout.signals == row.layout.signals:
                row.layout = layout
                continue
            row.layout, row.histories = layout, [ValueHistory() for _ in layout.signals]
            row.is_misfit = row.is_guess = False
            if not row.remote:
                self._note_doubts(row, Frame(row.can_id, row.data, row.extended, timestamp_s=row.last_s))
                for history, value in zip(row.histories, layout.read(row.data), strict=True):
                    if value is not None:
                        history.take(value, row.last_s)

    def gap(self, time_s: float, text: str) -> None:
        """Note a gap without frames until *time_s*, with *text* as an event; only events and frame count stay."""
        self.rows.clear()
        self.states.clear()
        self._received.clear()
        self.unlisted = 0
        self.load = BusLoad(self._bitrate)
        self.events.append(Event(time_s, text, bad=True))

    def sorted_rows(self) -> list[SeenFrame]:
        """Rows in the order of their CAN-IDs, 29-bit CAN-IDs behind, SDO (mostly dvtcli's own) last."""
        return sorted(self.rows.values(), key=lambda row: (row.service.kind == "sdo", row.extended, row.can_id))

    def forget(self) -> None:
        """Begin anew with all statistics."""
        for row in self.rows.values():
            row.count, row.rhythm = 0, FrameIntervals()
            for history in row.histories:
                history.forget()

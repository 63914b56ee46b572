"""A CANopenBus of simulated devices with a time of its own: whoever waits makes the clock go on, and nobody sleeps.

For one thread: with the same devices, faults and signals, the same calls see the same frames at the same times. Uses
the real SDO client. Does not know python-can, nor how a device behaves.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from heapq import heappop, heappush
from queue import SimpleQueue
from threading import RLock
from typing import TYPE_CHECKING

from dvtcli.bus.message_bus import SdoChannels
from dvtcli.bus.receiver import Tap, Traffic, Wake, bus_closed
from dvtcli.bus.sdo.client import SdoChannel
from dvtcli.bus.sdo.sdo_link import DEFAULT_RETRIES, DEFAULT_TIMEOUT_S, DroppedAnswers, Inbox
from dvtcli.bus.watched_bus import WatchedBus, act_of
from dvtcli.domain.can_ids import EMCY_BASE, HEARTBEAT_BASE, SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import Frame
from dvtcli.errors import BusUnavailable
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.station import Roster, SimulatedNode, stations

if TYPE_CHECKING:
    from dvtcli.simulator.network.signals import SimulatedSignal

#: from a frame of ours to a node's answer (s): two frames at 500 kbit/s and a quick device
ANSWER_S = 0.0005
_UPLOAD = b"\x40"
_NEVER = float("inf")


class VirtualTimeBus(WatchedBus):
    """A CanopenBus of *devices*, which boot now, with *faults* and *signals*; its clock starts at 0 s.

    Where it is not *simulated* whoever uses it takes it for one that others use, too, with nodes that outlive it. With
    *bit_rate* (bit/s) who runs at another one neither hears nor is heard. *name* is what it is called.
    """

    #: how many nodes are asked at once where none is OPERATIONAL
    most_at_once = 64

    def __init__(
        self,
        devices: Sequence[StrictDevice],
        *,
        faults: Sequence[Fault] = (),
        signals: Sequence[SimulatedSignal] = (),
        timeout_s: float = DEFAULT_TIMEOUT_S,
        retries: int = DEFAULT_RETRIES,
        simulated: bool = True,
        bit_rate: int | None = None,
        name: str = "virtual time",
    ) -> None:
        super().__init__(name, simulated=simulated, timeout_s=timeout_s, retries=retries)
        known_rates = () if bit_rate is None else None
        self.nodes = stations(devices, faults, signals, bit_rate=bit_rate, known_rates=known_rates)
        self._roster = Roster(self.nodes)
        self._lock = RLock()
        #: what we run at (bit/s), None where frames take no time; frames that not all could read
        self.bit_rate, self.destroyed = bit_rate, 0
        self._now_s = 0.0
        #: frames on their way to us: (time, order, frame)
        self._coming: list[tuple[float, int, Frame]] = []
        self._sent_by_nodes = 0
        self._channels = SdoChannels(self, self.settings)
        self._traffic: Traffic[Frame] = Traffic(lambda frame: frame, self.now_s)
        self._closed = False
        for node in self.nodes:
            if node.device.state is NmtState.INITIALISING:
                node.device.boot_up()
            self._poll(node)
        self.sleep(ANSWER_S)

    def join(self, devices: Sequence[StrictDevice]) -> None:
        """Let *devices* be on the bus, too, as they are."""
        self.nodes += stations(devices)
        self._roster = Roster(self.nodes)

    @property
    def runs_at(self) -> int | None:
        """The bit rate (bit/s) at which we hear and speak."""
        return self.bit_rate

    def require_settable(self, bit_rate: int, *, listen_only: bool = False) -> None:
        """Nothing stands in the way of another bit rate."""

    def set_bit_rate(self, bit_rate: int, *, listen_only: bool = False) -> None:
        """Hear and speak at *bit_rate* (bit/s) from now on."""
        self.bit_rate = bit_rate

    def error_frame_count(self) -> int:
        """How many frames not all could read so far."""
        return self.destroyed

    def now_s(self) -> float:
        """The virtual time in seconds."""
        return self._now_s

    def sleep(self, duration_s: float) -> None:
        """Let *duration_s* of virtual time pass; takes no real time. Raises BusUnavailable."""
        self._use()
        until_s = self._now_s + duration_s
        if duration_s > 0 and self._gave_turn_until(until_s):
            return
        while self._step(until_s):
            pass

    @property
    def carries_frames(self) -> bool:
        """Simulated nodes hear every frame."""
        return True

    @property
    def carries_remote_frames(self) -> bool:
        """Simulated nodes hear every frame."""
        return True

    def tap(self, callback: Tap) -> Callable[[], None]:
        """Call *callback*(frame, sent) for each frame received or sent here; returns what ends that."""
        return self._traffic.tap(callback)

    def exchanged(self) -> list[tuple[Frame, bool]]:
        """What was sent here, and the SDO answers, as on the product's own buses."""
        return self._traffic.exchanged()

    def send(self, frame: Frame) -> None:
        """Send one frame; frames that answer it are kept for a `receive` within the next second."""
        self.note_act(act_of(frame))
        self._traffic.keep_answers()
        self._send(frame)

    def receive(self, duration_s: float) -> Iterator[Frame]:
        """Yield every frame that arrives within *duration_s* of this call, and those since the last `send`."""
        self._use()
        return self._frames(self._traffic.listen(), self._now_s + duration_s)

    def idle(self, duration_s: float) -> None:
        """Let *duration_s* of virtual time pass, as `sleep` does."""
        self.sleep(duration_s)

    def close(self) -> None:
        """Leave the bus; whoever uses it afterwards gets BusUnavailable."""
        self._closed = True

    def send_sdo(self, can_id: int, data: bytes) -> None:
        """Send one SDO frame (SdoLink)."""
        self._send(Frame(can_id, data))

    def take(self, inbox: Inbox, deadline_s: float) -> bytes | None:
        """Wait for an SDO answer in *inbox* until *deadline_s* (SdoLink)."""
        self._use()
        if not self._gave_turn_for(inbox, deadline_s):
            self._until(lambda: not inbox.empty(), deadline_s)
        item = None if inbox.empty() else inbox.get_nowait()
        return None if isinstance(item, Wake) else item

    def drain(self) -> None:
        """Deliver what has arrived by now (SdoLink)."""
        self._use()
        while (self._coming and self._coming[0][0] <= self._now_s) or self._roster.next_s() <= self._now_s:
            self._step(self._now_s)

    def _use(self) -> None:
        """Raise BusUnavailable where the bus was closed, or a fault has killed it."""
        if self._closed:
            raise bus_closed()
        if self._roster.bus_failed:
            raise BusUnavailable(f"{self.name} failed", why="a simulated fault", hint="it stays so")

    def _send(self, frame: Frame) -> None:
        self._use()
        with self._lock:
            self._traffic.sent(frame)
            self._deliver(frame, sender=None)

    def _deliver(self, frame: Frame, sender: SimulatedNode | None) -> None:
        """Hand *frame* to every node but its sender, and what they send to us and to each other."""
        waiting = deque([(frame, sender)])
        while waiting:
            received, source = waiting.popleft()
            bit_rate = self.bit_rate if source is None else source.bit_rate
            self.destroyed += bit_rate != self.bit_rate or self._roster.are_others_than(bit_rate)
            for node in self._roster.listeners(received):
                if node is source or node.bit_rate != bit_rate:
                    continue
                for answer in node.handle(received, self._now_s):
                    if node.bit_rate == self.bit_rate:
                        self._to_us(answer)
                    waiting.append((answer, node))
                self._roster.looked_at(node)
        if frame.can_id & ~0x7F != SDO_REQUEST_BASE or frame.data[:1] != _UPLOAD:
            self._poll_due()  # a new heartbeat time counts from now on; reading changes nothing

    def _poll_due(self) -> None:
        for node in self._roster.due(self._now_s):
            self._poll(node)

    def _poll(self, node: SimulatedNode) -> None:
        frames = node.poll(self._now_s)
        self._roster.looked_at(node)
        self._spread(node, frames)

    def _spread(self, node: SimulatedNode, frames: list[Frame]) -> None:
        for frame in frames:
            if node.bit_rate == self.bit_rate:
                self._to_us(frame)
            self._deliver(frame, sender=node)

    def nodes_said(self, frame: Frame, after_s: float = ANSWER_S) -> None:
        """Let *frame* come from some node, *after_s* seconds of virtual time from now."""
        self._to_us(frame, after_s)

    def _to_us(self, frame: Frame, delay_s: float = ANSWER_S) -> None:
        due_s = self._now_s + delay_s
        self._sent_by_nodes += 1
        timed = Frame(frame.can_id, frame.data, frame.extended, frame.remote, due_s)
        heappush(self._coming, (due_s, self._sent_by_nodes, timed))

    def _step(self, until_s: float) -> bool:
        """Go on to the next thing that happens up to *until_s*, and let it happen; False, then, where nothing does."""
        with self._lock:  # a scan asks from threads of its own
            next_s = min(self._coming[0][0] if self._coming else _NEVER, self._roster.next_s())
            if next_s > until_s:
                self._now_s = max(self._now_s, until_s)
                return False
            self._now_s = max(self._now_s, next_s)
            if self._coming and self._coming[0][0] <= self._now_s:
                self._hear(heappop(self._coming)[2])
                return True
            self._poll_due()
            return True

    def _hear(self, frame: Frame) -> None:
        self._traffic.received(frame)
        if frame.can_id & ~0x7F == SDO_RESPONSE_BASE:
            self._traffic.answered(frame)
        function, node_id = frame.can_id & ~0x7F, frame.can_id & 0x7F
        if frame.remote or frame.extended:
            return
        if function == SDO_RESPONSE_BASE:
            self._watch.answered(node_id)
            self._channels.receive(node_id, frame.can_id, frame.data, extended=False)
        elif function == HEARTBEAT_BASE:
            self._watch.heartbeat(frame)
            if frame.data == b"\0":
                self._channels.restarted(node_id)
        elif function == EMCY_BASE:
            self._watch.emergency(frame)

    def _channel(self, node_id: int) -> SdoChannel:
        return self._channels.channel(node_id)

    def _repeated(self, node_id: int) -> int:
        return self._channels.repeated(node_id)

    def _dropped(self) -> dict[int, DroppedAnswers]:
        return self._channels.dropped()

    def _frames(self, received: SimpleQueue[Frame | Wake], until_s: float) -> Iterator[Frame]:
        while True:
            while not received.empty():
                frame = received.get_nowait()
                if isinstance(frame, Frame):  # nobody is woken here: one thread, and no leader among waiting ones
                    yield frame
            self._use()
            if not self._step(until_s) and received.empty():
                return

    def _wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until *condition* holds, which signs of life may bring about."""
        self._use()
        until_s = self._now_s + timeout_s
        if not self._gave_turn(condition, until_s):
            self._until(condition, until_s)
        return condition()

    def _until(self, ready: Callable[[], bool], deadline_s: float) -> None:
        while not ready() and self._step(deadline_s):
            pass

    def _most_at_once(self) -> int:
        return 1 if NmtState.OPERATIONAL in self._watch.states.values() else self.most_at_once

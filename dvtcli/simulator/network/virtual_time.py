"""A CANopenBus of simulated devices with a time of its own: whoever waits makes the clock go on, and nobody sleeps.

For one thread: with the same devices, faults and signals, the same calls see the same frames at the same times. Uses
the real SDO client. Does not know python-can, nor how a device behaves.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from heapq import heappop, heappush
from typing import TYPE_CHECKING
from weakref import ref

from dvtcli.bus import DEFAULT_RETRIES, DEFAULT_TIMEOUT_S
from dvtcli.bus.node_events import EMERGENCY, HEARTBEAT, NodeEvent, NodeWatch
from dvtcli.bus.receiver import Wake, bus_closed
from dvtcli.bus.sdo.channel import SdoChannel
from dvtcli.bus.sdo.client import StrictSdoClient
from dvtcli.bus.sdo.link import ANSWER_ID, REQUEST_ID, Inbox, SdoSettings
from dvtcli.bus.traffic import ANSWERS_KEPT_S, Tap
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.errors import BusUnavailable, UsageError
from dvtcli.simulator.device.faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.station import SimulatedNode, stations

if TYPE_CHECKING:
    from dvtcli.simulator.device.signals import Signal

#: from a frame of ours to a node's answer (s): two frames at 500 kbit/s and a quick device
ANSWER_S = 0.0005
_UPLOAD = b"\x40"
_NEVER = float("inf")


class VirtualTimeBus:
    """A CanopenBus of *devices*, which boot now, with *faults* and *signals*; its clock starts at 0 s."""

    def __init__(
        self,
        devices: Sequence[StrictDevice],
        *,
        faults: Sequence[Fault] = (),
        signals: Sequence[Signal] = (),
        timeout_s: float = DEFAULT_TIMEOUT_S,
        retries: int = DEFAULT_RETRIES,
    ) -> None:
        self.name = "virtual time"
        self.simulated = self.carries_remote_frames = True
        self.settings = SdoSettings(timeout_s, retries)
        self.nodes = stations(devices, faults, signals)
        self._now_s = 0.0
        #: frames on their way to us: (time, order, frame)
        self._coming: list[tuple[float, int, Frame]] = []
        self._sent_by_nodes = 0
        self._clients: dict[int, StrictSdoClient] = {}
        self._channels: dict[int, SdoChannel] = {}
        self._watch = NodeWatch()
        self._taps: list[Tap] = []
        self._listeners: list[ref[deque[Frame]]] = []
        self._kept: deque[Frame] = deque(maxlen=4096)
        self._kept_until_s = 0.0
        self._closed = False
        for node in self.nodes:
            if node.device.state is NmtState.INITIALISING:
                node.device.boot_up()
            self._spread(node, node.poll(0.0))
        self.sleep(ANSWER_S)

    def now_s(self) -> float:
        """The virtual time in seconds."""
        return self._now_s

    def sleep(self, duration_s: float) -> None:
        """Let *duration_s* of virtual time pass; takes no real time. Raises BusUnavailable."""
        self._use()
        until_s = self._now_s + duration_s
        while self._step(until_s):
            pass

    def sdo(self, node_id: int) -> SdoChannel:
        """The default SDO channel of *node_id* (1..127); the same object for the same node."""
        if node_id not in self._channels:
            if not 1 <= node_id <= 127:
                raise UsageError(f"node-ID {node_id} is outside 1..127")
            client = self._clients[node_id] = StrictSdoClient(node_id, self, self.settings)
            self._channels[node_id] = SdoChannel(client)
        return self._channels[node_id]

    def send_nmt(self, command: NmtCommand, node_id: int) -> None:
        """Send an NMT command to *node_id*, or to all nodes with 0; what was heard of their states is forgotten."""
        if not 0 <= node_id <= 127:
            raise UsageError(f"node-ID {node_id} is outside 0..127")
        self.drain()
        self._watch.forget_state(node_id)
        self.send(Frame(0x000, bytes([command, node_id])))

    def nmt_state(self, node_id: int, timeout_s: float = 0.0) -> NmtState | None:
        """The state last heard of *node_id* since its last NMT command; waits up to *timeout_s* for a *new* one."""
        self.drain()
        signs = self._watch.signs_of_life
        seen = signs.get(node_id, 0)
        if timeout_s > 0:
            self._wait_for(lambda: signs.get(node_id, 0) > seen, timeout_s)
        return self._watch.states.get(node_id)

    def boot_ups(self, node_id: int) -> int:
        """How many boot-up messages of *node_id* were seen so far."""
        self.drain()
        return self._watch.boot_ups.get(node_id, 0)

    def upsets(self, node_id: int) -> int:
        """A number that grows with each boot-up of *node_id*, and with each upload that had to be asked again."""
        client = self._clients.get(node_id)
        return self.boot_ups(node_id) + (0 if client is None else client.repeated)

    def downloads_of_others(self, node_id: int) -> int:
        """None: only this client is on the bus."""
        return self._watch.downloads_of_others.get(node_id, 0)

    def wait_boot_up(self, node_id: int, seen: int, timeout_s: float) -> bool:
        """Wait until more than *seen* boot-ups of *node_id* were received; False after *timeout_s*."""
        return self._wait_for(lambda: self._watch.boot_ups.get(node_id, 0) > seen, timeout_s)

    def on_event(self, callback: Callable[[NodeEvent], None]) -> Callable[[], None]:
        """Call *callback* for each boot-up, state change and emergency; returns what ends that."""
        self._watch.listeners.append(callback)
        return lambda: self._watch.listeners.remove(callback)

    def tap(self, callback: Tap) -> Callable[[], None]:
        """Call *callback*(frame, sent) for each frame received or sent here; returns what ends that."""
        self._taps.append(callback)
        return lambda: self._taps.remove(callback)

    def send(self, frame: Frame) -> None:
        """Send one frame; frames that answer it are kept for a `receive` within the next second."""
        self._kept.clear()
        self._kept_until_s = self._now_s + ANSWERS_KEPT_S
        self._send(frame)

    def receive(self, duration_s: float) -> Iterator[Frame]:
        """Yield every frame that arrives within *duration_s* of this call, and those since the last `send`."""
        self._use()
        heard = deque(self._kept)
        self._kept.clear()
        self._kept_until_s = 0.0
        self._listeners.append(ref(heard, self._listeners.remove))
        return self._frames(heard, self._now_s + duration_s)

    def close(self) -> None:
        """Leave the bus; whoever uses it afterwards gets BusUnavailable."""
        self._closed = True

    def send_sdo(self, can_id: int, data: bytes) -> None:
        """Send one SDO frame (SdoLink)."""
        self._send(Frame(can_id, data))

    def take(self, inbox: Inbox, deadline_s: float) -> bytes | None:
        """Wait for an SDO answer in *inbox* until *deadline_s* (SdoLink)."""
        self._use()
        while inbox.empty() and self._step(deadline_s):
            pass
        item = None if inbox.empty() else inbox.get_nowait()
        return None if isinstance(item, Wake) else item

    def drain(self) -> None:
        """Deliver what has arrived by now (SdoLink)."""
        self.sleep(0.0)

    def _use(self) -> None:
        """Raise BusUnavailable where the bus was closed, or a fault has killed it."""
        if self._closed:
            raise bus_closed()
        for node in self.nodes:
            if node.bus_failed:
                raise BusUnavailable(f"{self.name} failed", why="a simulated fault", hint="it stays so")

    def _send(self, frame: Frame) -> None:
        self._use()
        self._tell_taps(frame, sent=True)
        self._deliver(frame, sender=None)

    def _deliver(self, frame: Frame, sender: SimulatedNode | None) -> None:
        """Hand *frame* to every node but its sender, and what they send to us and to each other."""
        waiting = deque([(frame, sender)])
        while waiting:
            heard, source = waiting.popleft()
            for node in self.nodes:
                if node is source:
                    continue
                for answer in node.handle(heard, self._now_s):
                    self._to_us(answer)
                    waiting.append((answer, node))
        if frame.can_id & ~0x7F != REQUEST_ID or frame.data[:1] != _UPLOAD:
            for node in self.nodes:  # a new heartbeat time counts from now on; reading changes nothing
                self._spread(node, node.poll(self._now_s))

    def _spread(self, node: SimulatedNode, frames: list[Frame]) -> None:
        for frame in frames:
            self._to_us(frame)
            self._deliver(frame, sender=node)

    def _to_us(self, frame: Frame) -> None:
        due_s = self._now_s + ANSWER_S
        self._sent_by_nodes += 1
        timed = Frame(frame.can_id, frame.data, frame.extended, frame.remote, due_s)
        heappush(self._coming, (due_s, self._sent_by_nodes, timed))

    def _step(self, until_s: float) -> bool:
        """Go on to the next thing that happens up to *until_s*, and let it happen; False, then, where nothing does."""
        next_s = self._coming[0][0] if self._coming else _NEVER
        for node in self.nodes:
            due_s = node.next_poll_s()
            if due_s is not None and due_s < next_s:
                next_s = due_s
        if next_s > until_s:
            self._now_s = max(self._now_s, until_s)
            return False
        self._now_s = max(self._now_s, next_s)
        if self._coming and self._coming[0][0] <= self._now_s:
            self._hear(heappop(self._coming)[2])
            return True
        for node in self.nodes:
            self._spread(node, node.poll(self._now_s))
        return True

    def _hear(self, frame: Frame) -> None:
        self._tell_taps(frame, sent=False)
        if self._now_s < self._kept_until_s:
            self._kept.append(frame)
        for listener in tuple(self._listeners):
            heard = listener()
            if heard is not None:
                heard.append(frame)
        function, node_id = frame.can_id & ~0x7F, frame.can_id & 0x7F
        if frame.remote or frame.extended:
            return
        if function == ANSWER_ID and node_id in self._clients:
            self._clients[node_id].receive(frame.can_id, frame.data, extended=False)
        elif function == HEARTBEAT:
            self._watch.heartbeat(frame)
        elif function == EMERGENCY:
            self._watch.emergency(frame)

    def _tell_taps(self, frame: Frame, *, sent: bool) -> None:
        for tap in tuple(self._taps):
            tap(frame, sent)

    def _frames(self, heard: deque[Frame], until_s: float) -> Iterator[Frame]:
        while True:
            while heard:
                yield heard.popleft()
            self._use()
            if not self._step(until_s) and not heard:
                return

    def _wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until *condition* holds, which signs of life may bring about."""
        self._use()
        until_s = self._now_s + timeout_s
        while not condition() and self._step(until_s):
            pass
        return condition()

"""Simulated nodes on a shared bus, with a wire's timing: frames between nodes, clients and other buses."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from heapq import heappop, heappush
from queue import Empty, SimpleQueue
from time import monotonic, time
from typing import Protocol

from dvtcli.domain.can_ids import SDO_RESPONSE_BASE
from dvtcli.domain.frame_bits import arbitration, frame_bits
from dvtcli.domain.ports import CanopenBus, Frame
from dvtcli.errors import BusUnavailable
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.hub import Hub
from dvtcli.simulator.network.hub_client import Client, frame_line
from dvtcli.simulator.network.station import Roster, SimulatedNode

#: Waits for the bus that failed until it is back, or (None) until the function that it is given says to stop.
ComeBack = Callable[[CanopenBus, BusUnavailable, Callable[[], bool]], CanopenBus | None]
#: how long the thread listens before it looks whether it should end (s)
_LISTEN_S = 0.2


class JoinedBus:
    """*bus* as a member; *wake* is called from another thread after a frame or a failure.

    With *come_back* a lost bus is waited for; frames of the nodes are lost meanwhile.
    """

    def __init__(self, bus: CanopenBus, wake: Callable[[], None], come_back: ComeBack | None = None) -> None:
        self._bus = bus
        self._wake = wake
        self._come_back = come_back
        self._arrived: SimpleQueue[Frame] = SimpleQueue()
        self._failure: BusUnavailable | None = None
        self._leaving = False
        self._untap = bus.tap(self._received)
        self._thread = threading.Thread(target=self._listen, name=f"listens to {bus.name}", daemon=True)
        self._thread.start()

    @property
    def name(self) -> str:
        """The name of the bus for display."""
        return self._bus.name

    def tell(self, frame: Frame) -> None:
        """Send *frame*. Raises BusUnavailable if the bus failed and is not waited for."""
        try:
            self._bus.send(frame)
        except BusUnavailable:
            if self._come_back is None:
                raise

    def received(self) -> list[Frame]:
        """The frames received since the last call. Raises BusUnavailable if the bus failed."""
        if self._failure is not None:
            raise self._failure
        frames: list[Frame] = []
        while True:
            try:
                frames.append(self._arrived.get_nowait())
            except Empty:
                return frames

    def close(self) -> None:
        """Leave the bus."""
        self._leaving = True
        self._untap()
        self._bus.close()
        self._thread.join()

    def _received(self, frame: Frame, sent: bool) -> None:
        if not sent:
            self._arrived.put(frame)
            self._wake()

    def _listen(self) -> None:
        while not self._leaving:
            try:
                self._bus.idle(_LISTEN_S)
            except BusUnavailable as failure:
                if self._leaving or not self._is_back(failure):
                    self._failure = failure
                    self._wake()
                    return

    def _is_back(self, failure: BusUnavailable) -> bool:
        """Wait for the failed bus and reconnect; true if it is back."""
        if self._come_back is None:
            return False
        self._bus.close()
        bus = self._come_back(self._bus, failure, lambda: self._leaving)
        if bus is None:
            return False
        self._bus = bus
        self._untap = bus.tap(self._received)
        return True


#: longest wait (s) where nothing is due: whoever has something wakes the thread
_LONGEST_WAIT_S = 1.0
#: the end of a frame's time is spent watching the clock, since the system wakes a thread some 0.1 ms late (s)
_WATCHED_S = 0.0002
#: frames of one source that may wait for the wire before it is not read any more
_MOST_WAITING = 64
#: frames between two looks at the clients: nodes that answer each other for ever must not keep them out
_AT_ONCE = 2000


class Member(Protocol):
    """Another bus joined by the nodes."""

    def tell(self, frame: Frame) -> None:
        """Send *frame* on the bus."""
        ...

    def received(self) -> list[Frame]:
        """The frames received since the last call."""
        ...


class Server:
    """Serves *nodes* to the clients of *hub* and to the other buses *members*.

    *latencies_s* are the response times of the nodes' SDO servers (s), none for at once. *stored* is called after a
    change of stored values, before the device's answer is sent; *bus_failed* after a fault killed the bus;
    *frames_lost* when nodes first send more than the bus carries.
    """

    def __init__(
        self,
        nodes: Sequence[SimulatedNode],
        hub: Hub,
        wire: Wire,
        members: Sequence[Member] = (),
        *,
        latencies_s: Sequence[float] = (),
        stored: Callable[[StrictDevice], None] = lambda _device: None,
        bus_failed: Callable[[], None] = lambda: None,
        frames_lost: Callable[[], None] = lambda: None,
    ) -> None:
        self.hub = hub
        #: the number of frames on the bus so far
        self.frames = 0
        self._wire = wire
        self._members = members
        self._nodes = tuple(nodes)
        self._latencies_s = dict(zip(nodes, latencies_s, strict=False))
        self._stored, self._on_stored = {node: node.device.areas.changes for node in nodes}, stored
        self._bus_failed, self._on_bus_failed = False, bus_failed
        self._frames_lost, self._on_frames_lost = False, frames_lost
        self._roster = Roster(self._nodes)
        #: SDO answers that a server is still thinking about: (time, order, node, frame)
        self._thinking: list[tuple[float, int, SimulatedNode, Frame]] = []
        self._answers = 0
        self._wall_s = time() - monotonic()
        self._stopping = False

    def stop(self) -> None:
        """Let `run` return soon; callable from any thread."""
        self._stopping = True
        self.hub.wake()

    def run(self) -> None:
        """Boot the nodes and serve them until `stop`. Raises the errors of members."""
        now_s = monotonic()
        for node in self._nodes:
            node.device.boot_up()
            self._poll(node, now_s)
        while not self._stopping:
            self._move()
            for client, frame in self.hub.wait(self._wait_s(), self._may_read):
                self._wire.offer(client, frame, monotonic())

    def _may_read(self, client: Client) -> bool:
        return self._wire.waiting(client) < _MOST_WAITING

    def _wait_s(self) -> float:
        """Seconds until the next due time."""
        due_s = monotonic() + _LONGEST_WAIT_S
        wire_s = self._wire.next_s()
        if wire_s is not None:
            due_s = min(due_s, wire_s - _WATCHED_S)
        if self._thinking:
            due_s = min(due_s, self._thinking[0][0])
        return max(0.0, min(due_s, self._roster.next_s()) - monotonic())

    def _move(self) -> None:
        """Carry out everything due."""
        now_s = monotonic()
        for member in self._members:
            for frame in member.received():
                self._wire.offer(member, frame, now_s)
        for node in self._roster.due(now_s):
            self._poll(node, now_s)
        for _ in range(_AT_ONCE):
            while self._thinking and self._thinking[0][0] <= now_s:
                at_s, _, node, frame = heappop(self._thinking)
                self._wire.offer(node, frame, at_s)
            arrived = self._wire.take(now_s)
            if arrived is None:
                return
            self._deliver(*arrived)

    def _deliver(self, at_s: float, source: object, frame: Frame) -> None:
        """Deliver *frame* of *source*, complete at *at_s*, to everybody else."""
        self.frames += 1
        if self.hub.clients:
            self.hub.tell_all(frame_line(frame, self._wall_s + at_s), source)
        for member in self._members:
            if member is not source:
                member.tell(frame)
        for node in self._roster.listeners(frame):
            if node is not source:
                self._hear(node, frame, at_s)

    def _hear(self, node: SimulatedNode, frame: Frame, at_s: float) -> None:
        answers = node.handle(frame, at_s)
        if node.device.areas.changes != self._stored[node]:
            self._stored[node] = node.device.areas.changes
            self._on_stored(node.device)
        for answer in answers:
            self._say(node, answer, at_s)
        self._poll(node, at_s)
        if node.bus_failed and not self._bus_failed:
            self._bus_failed = True
            self.hub.cut()
            self._on_bus_failed()

    def _poll(self, node: SimulatedNode, now_s: float) -> None:
        for frame in node.poll(now_s):
            self._say(node, frame, now_s)
        self._roster.looked_at(node)

    def _say(self, node: SimulatedNode, frame: Frame, at_s: float) -> None:
        """Send *frame* of *node*; an SDO answer after its latency."""
        latency_s = self._latencies_s.get(node)
        if latency_s and frame.can_id == SDO_RESPONSE_BASE + node.device.node_id and not frame.extended:
            self._answers += 1
            heappush(self._thinking, (at_s + latency_s, self._answers, node, frame))
        elif self._wire.full(node):
            self._lose()
        else:
            self._wire.offer(node, frame, at_s)

    def _lose(self) -> None:
        """Drop a frame, with a report the first time."""
        if not self._frames_lost:
            self._frames_lost = True
            self._on_frames_lost()


#: frames of one source, or of all where they take no time, that wait before the wire is full
_MOST_OF_ONE, _MOST_OF_ALL = 512, 10_000


class Wire:
    """A bus of *bitrate* bit/s with one frame at a time; without a bit rate frames take no time.

    Each *source* sends its frames in order; among waiting sources the lowest CAN-ID wins. Without a bit rate frames
    travel in the order of `offer`.
    """

    def __init__(self, bitrate: int | None = None) -> None:
        self._bit_s = 0.0 if bitrate is None else 1 / bitrate
        self._waiting: dict[object, deque[tuple[float, Frame]]] = {}
        #: the first waiting frame of each source: (time, order, source) if due after the last check of the
        #: wire, else (priority, order, source)
        self._later: list[tuple[float, int, object]] = []
        self._ready: list[tuple[int, int, object]] = []
        self._heads = 0
        self._straight: deque[tuple[float, object, Frame]] = deque()
        self._free_s = 0.0
        self._travelling: tuple[float, object, Frame] | None = None

    def offer(self, source: object, frame: Frame, at_s: float) -> None:
        """Queue *frame* of *source*, ready to be sent from *at_s* on."""
        if not self._bit_s:
            self._straight.append((at_s, source, frame))
        elif source in self._waiting:
            self._waiting[source].append((at_s, frame))
        else:
            self._waiting[source] = deque([(at_s, frame)])
            self._is_head(source)

    def waiting(self, source: object) -> int:
        """The number of frames of *source* (of all without a bit rate) that have not begun to travel."""
        if not self._bit_s:
            return len(self._straight)
        queue = self._waiting.get(source)
        return 0 if queue is None else len(queue)

    def full(self, source: object) -> bool:
        """True if the queue of node *source* is full and its further frames are lost."""
        return self.waiting(source) >= (_MOST_OF_ONE if self._bit_s else _MOST_OF_ALL)

    def take(self, now_s: float) -> tuple[float, object, Frame] | None:
        """The next frame complete by *now_s*, with the time of its last bit and its source; None for none."""
        if self._straight:
            return self._straight.popleft()
        self._begin(now_s)
        if self._travelling is None or self._travelling[0] > now_s:
            return None
        arrived, self._travelling = self._travelling, None
        return arrived

    def next_s(self) -> float | None:
        """The time of the next result of `take`; None without a frame."""
        if self._straight:
            return 0.0
        if self._travelling is not None:
            return self._travelling[0]
        return self._start_s()

    def _start_s(self) -> float | None:
        """The start time of the next frame, None without a waiting frame."""
        if self._ready:
            return self._free_s
        return max(self._free_s, self._later[0][0]) if self._later else None

    def _is_head(self, source: object) -> None:
        """Enter the first frame of *source* into arbitration from its time on."""
        self._heads += 1
        heappush(self._later, (self._waiting[source][0][0], self._heads, source))

    def _begin(self, now_s: float) -> None:
        """Start the winner of the arbitration, unless later than *now_s*."""
        start_s = None if self._travelling is not None else self._start_s()
        if start_s is None or start_s > now_s:
            return
        while self._later and self._later[0][0] <= start_s:
            _, order, source = heappop(self._later)
            heappush(self._ready, (_priority(self._waiting[source][0][1]), order, source))
        winner = heappop(self._ready)[2]
        _, frame = self._waiting[winner].popleft()
        if self._waiting[winner]:
            self._is_head(winner)
        else:
            del self._waiting[winner]
        self._free_s = start_s + frame_bits(frame.can_id, frame.data, frame.extended, frame.remote) * self._bit_s
        self._travelling = (self._free_s, winner, frame)


def _priority(frame: Frame) -> int:
    return arbitration(frame.can_id, extended=frame.extended, remote=frame.remote)

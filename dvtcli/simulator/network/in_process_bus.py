"""A bus of simulated devices inside this process.

Without a thread: nodes answer while a frame is sent, and act by themselves, each at its time, during a read or a send.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from queue import Empty, Queue
from time import monotonic, time
from typing import TYPE_CHECKING

from dvtcli.bus.error_frames import ErrorFrames
from dvtcli.bus.message_bus import MessageBus
from dvtcli.bus.receiver import bus_closed
from dvtcli.bus.sdo.sdo_link import DEFAULT_RETRIES, DEFAULT_TIMEOUT_S
from dvtcli.bus.turns import one_by_one
from dvtcli.domain.ports import Frame, SdoTransport
from dvtcli.errors import BusUnavailable, SdoAborted
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.sdo_server import SILENT
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.station import Roster, SimulatedNode, stations

if TYPE_CHECKING:
    from dvtcli.simulator.device.simulated_faults import Fault
    from dvtcli.simulator.network.signals import SimulatedSignal


#: Nodes that answer each other for ever must not keep others out, nor flood the bus: after so many frames it rests (s).
_AT_ONCE, _REST_S = 500, 0.02
#: Frames that nodes have not heard yet; what more they want to send is lost, as on a bus that is never silent.
_MOST_WAITING = 4096
#: What was due while nobody looked happens at its own time, up to so many times; then all that is left happens now.
_MOST_MISSED = 1000


class NodesOnABus:
    """*devices* with their *faults* and *signals*; *say* is called with each frame sent and its time.

    With *bit_rate* (bit/s) a node receives only frames at its own bit rate, and *destroyed* is called for each frame
    unreadable for a node on the bus: CAN repeats the frame until the others stop disturbing it.

    Times are seconds on a monotonic clock of the caller.
    """

    def __init__(
        self,
        devices: Sequence[StrictDevice],
        faults: Sequence[Fault],
        signals: Sequence[SimulatedSignal],
        say: Callable[[Frame, float], None],
        *,
        bit_rate: int | None = None,
        destroyed: Callable[[], None] = lambda: None,
    ) -> None:
        known_rates = () if bit_rate is None else None
        self.nodes = stations(devices, faults, signals, bit_rate=bit_rate, known_rates=known_rates)
        #: the bit rate of real participants (bit/s), and whether they only listen
        self.bit_rate, self.only_received = bit_rate, False
        self._roster = Roster(self.nodes)
        self._say = say
        self._destroyed = destroyed
        self._now_s = 0.0
        self._rests_until_s = 0.0
        #: frames not yet delivered to the nodes, with sender and bit rate
        self._said: deque[tuple[Frame, SimulatedNode | None, int | None]] = deque()

    @property
    def bus_failed(self) -> bool:
        """True if a fault has killed the bus."""
        return self._roster.bus_failed

    def boot(self, now_s: float) -> None:
        """Start every node at *now_s*, with its boot-up message."""
        self._now_s = now_s
        for node in self.nodes:
            node.device.boot_up()
            self._poll_node(node, now_s)

    def hear(self, frame: Frame, now_s: float) -> None:
        """Deliver the foreign *frame* to every node at *now_s*; immediate answers are sent before the return."""
        self.pass_time(now_s)
        self._carry(frame, None, self.bit_rate)
        self._settle(rested=True)
        self._poll(now_s)

    def pass_time(self, now_s: float) -> None:
        """Carry out everything due by *now_s*, each at its own time."""
        for _ in range(_MOST_MISSED):
            due_s = self._roster.next_s()
            if due_s > now_s:
                break
            self._poll(max(due_s, self._now_s))
        else:
            self._poll(now_s)
        self._now_s = now_s
        if self._said:
            self._settle()

    def next_s(self) -> float:
        """The next due time, infinite for never."""
        due_s = self._roster.next_s()
        return min(due_s, self._rests_until_s) if self._said else due_s

    def _poll(self, now_s: float) -> None:
        self._now_s = now_s
        for node in self._roster.due(now_s):
            self._poll_node(node, now_s)
        self._settle()

    def _poll_node(self, node: SimulatedNode, now_s: float) -> None:
        self._send(node, node.poll(now_s))
        self._roster.looked_at(node)

    def _settle(self, *, rested: bool = False) -> None:
        """Deliver the pending frames of nodes and bus to every node, and the answers to them."""
        if self._now_s < self._rests_until_s and not rested:
            return
        for _ in range(_AT_ONCE):
            if not self._said:
                return
            received, sender, bit_rate = self._said.popleft()
            for node in self._roster.listeners(received):
                if node is not sender and node.bit_rate == bit_rate:
                    self._send(node, node.handle(received, self._now_s))
                    self._roster.looked_at(node)
        self._rests_until_s = self._now_s + _REST_S

    def _send(self, node: SimulatedNode, frames: list[Frame]) -> None:
        for frame in frames:
            if len(self._said) >= _MOST_WAITING:
                return
            if node.bit_rate == self.bit_rate:
                self._say(frame, self._now_s)
            self._carry(frame, node, node.bit_rate)

    def _carry(self, frame: Frame, sender: SimulatedNode | None, bit_rate: int | None) -> None:
        """Deliver *frame* to the nodes at *bit_rate*; at another bit rate we destroy it, unless we only listen."""
        if bit_rate != self.bit_rate or self._roster.are_others_than(bit_rate):
            self._destroyed()
        if bit_rate == self.bit_rate or self.only_received:
            self._said.append((frame, sender, bit_rate))


#: what nodes run at where nobody says it (bit/s)
BIT_RATE = 500_000


class InProcessBus(MessageBus[Frame]):
    """A CanopenBus of *devices*, with their *faults* and *signals*, which boot now.

    *timeout_s* (s) and *retries* are those of `SdoSettings`. A fault may kill the bus like an unplugged adapter. Frames
    take no time; *bit_rate* (bit/s) only decides about reception.
    """

    def __init__(
        self,
        devices: Sequence[StrictDevice],
        *,
        faults: Sequence[Fault] = (),
        signals: Sequence[SimulatedSignal] = (),
        timeout_s: float = DEFAULT_TIMEOUT_S,
        retries: int = DEFAULT_RETRIES,
        bit_rate: int = BIT_RATE,
    ) -> None:
        super().__init__("sim", lambda frame: frame, simulated=True, timeout_s=timeout_s, retries=retries)
        #: held while time passes for the nodes, or they hear a frame
        self._lock = threading.Lock()
        #: no SimpleQueue: after a spurious wake-up at the time-out CPython's waits forever
        self._said: Queue[Frame] = Queue()
        self._wall_s = time() - monotonic()
        self._error_frames = ErrorFrames()
        self._nodes = NodesOnABus(
            devices, faults, signals, self._say, bit_rate=bit_rate, destroyed=self._error_frames.count_one
        )
        self._nodes.boot(monotonic())
        self._devices = {device.node_id: device for device in devices}
        self._reads_at_once = False
        self._at_once: dict[int, _AtOnce] = {}

    @property
    def runs_at(self) -> int | None:
        """Our bit rate (bit/s)."""
        return self._nodes.bit_rate

    def require_settable(self, bit_rate: int, *, listen_only: bool = False) -> None:
        """Accept every bit rate."""

    def set_bit_rate(self, bit_rate: int, *, listen_only: bool = False) -> None:
        """Run at *bit_rate* (bit/s) from now on; with *listen_only* only receive, without disturbing others."""
        with self._lock:
            self._nodes.pass_time(monotonic())
            self._nodes.bit_rate, self._nodes.only_received = bit_rate, listen_only

    def error_frame_count(self) -> int:
        """The number of frames destroyed so far by different bit rates on the bus."""
        return self._error_frames.count

    def read_at_once(self) -> None:
        """Let objects be read without frames from now on, one node after the other: nobody watches this bus.

        What nodes send by themselves is delivered no more.
        """
        self.drain()
        self._reads_at_once = True

    def side_by_side(self, jobs: Sequence[Callable[[], None]]) -> list[BaseException]:
        """Do *jobs*: side by side, unless nodes are read at once."""
        return one_by_one(jobs) if self._reads_at_once else super().side_by_side(jobs)

    def sdo(self, node_id: int) -> SdoTransport:
        """The default SDO channel of *node_id* (1..127)."""
        channel, device = super().sdo(node_id), self._devices.get(node_id)
        if device is None or not self._reads_at_once:
            return channel
        if node_id not in self._at_once:
            self._at_once[node_id] = _AtOnce(device, channel)
        return self._at_once[node_id]

    def drain(self) -> None:
        """Deliver pending frames; none if no frame was sent and no action is due, or if nodes are read at once."""
        if self._reads_at_once:
            return
        with self._lock:
            nodes = self._nodes
            is_quiet = self._said.empty() and not nodes.bus_failed and nodes.next_s() > monotonic()
        if not is_quiet:
            super().drain()

    def disturbances(self) -> list[str]:
        """Disturbances since the last call: error frames, another SDO client, a node-ID used twice."""
        odd = super().disturbances()
        return [*self._error_frames.news(), *odd]

    def _say(self, frame: Frame, at_s: float) -> None:
        self._said.put(Frame(frame.can_id, frame.data, frame.extended, frame.remote, self._wall_s + at_s))

    def _send(self, can_id: int, data: bytes, *, extended: bool = False, remote: bool = False, dlc: int = 0) -> None:
        if self._closed:
            raise bus_closed()
        self._check_if_alive("send")
        if self._nodes.only_received:
            raise BusUnavailable("nothing is sent while it is only listened")
        frame = Frame(can_id, data, extended, remote, dlc=dlc)
        self._traffic.sent(frame)
        with self._lock:
            self._nodes.hear(frame, monotonic())

    def _read(self, wait_s: float) -> Frame | None:
        until_s = monotonic() + wait_s
        while True:
            self._check_if_alive("receive")
            if self._said.empty():
                left_s = self._pass_time(until_s)
                if self._said.empty() and left_s <= 0:
                    return None
                with suppress(Empty):
                    return self._said.get(timeout=max(0.0, left_s))  # another thread's `send` ends the wait as well
            else:
                return self._said.get_nowait()  # one thread reads at a time

    def _pass_time(self, until_s: float) -> float:
        """Carry out everything due; seconds until the next due time, or until *until_s*."""
        with self._lock:
            now_s = monotonic()
            self._nodes.pass_time(now_s)
            return until_s - now_s if now_s >= until_s else min(until_s, self._nodes.next_s()) - now_s

    def _deliver(self, message: Frame) -> None:
        self._traffic.received(message)
        if not message.remote:
            self._understand(message, message.can_id, message.data, extended=message.extended)

    def _leave(self) -> None:
        """Do nothing: the nodes end with the owner of the bus."""

    def _check_if_alive(self, what: str) -> None:
        if self._nodes.bus_failed:
            hint = "is the adapter still plugged in, and the interface up?"
            raise BusUnavailable(
                f"{self.name} failed ({what})", why="the bus has failed (a simulated fault)", hint=hint
            )


class _AtOnce:
    """The SDO channel of *device* whose objects are read without a frame; all else goes by *channel*."""

    def __init__(self, device: StrictDevice, channel: SdoTransport) -> None:
        self._device, self._channel = device, channel

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """Read an object as the device holds it; by frames while it answers none."""
        if self._device.state in SILENT:
            return self._channel.upload(index, sub_index, timeout_s=timeout_s, retries=retries)
        try:
            return self._device.upload(index, sub_index)
        except Refusal as refusal:
            raise SdoAborted(index, sub_index, refusal.code, node=self._device.node_id) from refusal

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        """Write an object."""
        self._channel.download(index, sub_index, data, timeout_s=timeout_s)


def simulate(
    devices: Sequence[StrictDevice],
    *,
    faults: Sequence[Fault] = (),
    signals: Sequence[SimulatedSignal] = (),
    timeout_s: float = DEFAULT_TIMEOUT_S,
    retries: int = DEFAULT_RETRIES,
    bit_rate: int = BIT_RATE,
) -> InProcessBus:
    """Start *devices* with *faults* and *signals* on a new bus at *bit_rate* (bit/s), and join it."""
    return InProcessBus(
        devices, faults=faults, signals=signals, timeout_s=timeout_s, retries=retries, bit_rate=bit_rate
    )

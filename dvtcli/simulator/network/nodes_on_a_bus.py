"""Simulated nodes on one bus: they hear each other as well as those who are not simulated.

Time is passed in. Does not know what carries frames, nor threads or clocks.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from dvtcli.domain.ports import Frame
from dvtcli.simulator.network.roster import Roster
from dvtcli.simulator.network.station import SimulatedNode, stations

if TYPE_CHECKING:
    from dvtcli.simulator.device.simulated_faults import Fault
    from dvtcli.simulator.device.strict_device import StrictDevice
    from dvtcli.simulator.network.signals import SimulatedSignal

#: Nodes that answer each other for ever must not keep others out, nor flood the bus: after so many frames it rests (s).
_AT_ONCE, _REST_S = 500, 0.02
#: Frames that nodes have not heard yet; what more they want to send is lost, as on a bus that is never silent.
_MOST_WAITING = 4096
#: What was due while nobody looked happens at its own time, up to so many times; then all that is left happens now.
_MOST_MISSED = 1000


class NodesOnABus:
    """*devices* with their *faults* and *signals*; *say* is called for each frame that one sends, with its time.

    With *bit_rate* (bit/s) a node hears only what is sent at its own one, and *destroyed* is called for each frame that
    not all on the bus can read: CAN repeats it until those others have given up disturbing it.

    Times are seconds on a monotonic clock of the caller's.
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
        #: what those who are not simulated run at (bit/s), and whether they only listen
        self.bit_rate, self.only_heard = bit_rate, False
        self._roster = Roster(self.nodes)
        self._say = say
        self._destroyed = destroyed
        self._now_s = 0.0
        self._rests_until_s = 0.0
        #: what was said on the bus, with the node that said it and its bit rate, and not heard by the nodes yet
        self._said: deque[tuple[Frame, SimulatedNode | None, int | None]] = deque()

    @property
    def bus_failed(self) -> bool:
        """Whether a fault has killed the bus."""
        return self._roster.bus_failed

    def boot(self, now_s: float) -> None:
        """Start every node at *now_s*: its boot-up is said."""
        self._now_s = now_s
        for node in self.nodes:
            node.device.boot_up()
            self._poll_node(node, now_s)

    def hear(self, frame: Frame, now_s: float) -> None:
        """Let every node hear *frame* of somebody else at *now_s*; what answers at once has been said on return."""
        self.pass_time(now_s)
        self._carry(frame, None, self.bit_rate)
        self._settle(rested=True)
        self._poll(now_s)

    def pass_time(self, now_s: float) -> None:
        """Let all happen that is due by *now_s*, each at its own time."""
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
        """When something is due, infinite for never."""
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
        """Let every node hear what the others and the bus have said, and what is answered to that."""
        if self._now_s < self._rests_until_s and not rested:
            return
        for _ in range(_AT_ONCE):
            if not self._said:
                return
            heard, sender, bit_rate = self._said.popleft()
            for node in self._roster.listeners(heard):
                if node is not sender and node.bit_rate == bit_rate:
                    self._send(node, node.handle(heard, self._now_s))
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
        """Let *frame* be heard by those who run at *bit_rate*; we destroy it for all if we speak at another one."""
        if bit_rate != self.bit_rate or self._roster.are_others_than(bit_rate):
            self._destroyed()
        if bit_rate == self.bit_rate or self.only_heard:
            self._said.append((frame, sender, bit_rate))

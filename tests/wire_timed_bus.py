"""A bus in virtual time whose frames take time on the wire, the lowest CAN-ID first, and whose SDO servers think.

Each node sends its frames in their order: what it wants to say waits behind its heartbeat, as in a controller with one
transmit queue. Real SDO client; does not know python-can.
"""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heappop, heappush
from math import inf

from dvtcli.domain.can_ids import SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.domain.frame_bits import frame_bits
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.shared_bus import Wire
from dvtcli.simulator.network.station import SimulatedNode
from tests.virtual_time import VirtualTimeBus


class WireTimedBus(VirtualTimeBus):
    """A bus of *bitrate* bit/s whose nodes answer an SDO request *server_s* after its last bit.

    Who uses it knows the bit rate unless it is not *known*.
    """

    def __init__(self, devices: Sequence[StrictDevice], bitrate: int, server_s: float, *, known: bool = True) -> None:
        self.wire, self.wire_bitrate, self.server_s = Wire(bitrate), bitrate, server_s
        #: frames that nodes are still thinking about: (time, order, node, frame)
        self._answers: list[tuple[float, int, SimulatedNode, Frame]] = []
        self._order = 0
        #: what passed since `begin`: bits, and how long each node's chain of requests and answers takes at least (s)
        self.bits = 0
        self.chains_s: dict[int, float] = {}
        #: the longest that a frame of each CAN-ID waited for the wire (s)
        self.waited_s: dict[int, float] = {}
        self._offered_s: dict[int, list[float]] = {}
        super().__init__(devices)
        self.bitrate = bitrate if known else None

    def begin(self) -> None:
        """Count from here on."""
        self.bits, self.chains_s, self.waited_s = 0, {}, {}

    def limit_s(self) -> float:
        """The least time that what was sent since then could take."""
        return max(self.bits / self.wire_bitrate, max(self.chains_s.values(), default=0.0))

    def _send(self, frame: Frame) -> None:
        self._use()
        self._traffic.sent(frame)
        self._offer(None, frame, self._now_s)

    def _poll(self, node: SimulatedNode) -> None:
        for frame in node.poll(self._now_s):
            self._offer(node, frame, self._now_s)
        self._roster.looked_at(node)

    def _offer(self, source: object, frame: Frame, at_s: float) -> None:
        self._offered_s.setdefault(frame.can_id, []).append(at_s)
        self.wire.offer(source, frame, at_s)

    def next_s(self) -> float:
        """When something happens next; infinite for never."""
        wire_s, answer_s = self.wire.next_s(), self._answers[0][0] if self._answers else inf
        return min(self._roster.next_s(), answer_s, inf if wire_s is None else wire_s)

    def _step(self, until_s: float) -> bool:
        next_s = max(self._now_s, self.next_s())
        if next_s > until_s:
            self._now_s = max(self._now_s, until_s)
            return False
        self._now_s = next_s
        self._poll_due()
        while self._answers and self._answers[0][0] <= next_s:
            _, _, node, frame = heappop(self._answers)
            self._offer(node, frame, next_s)
        arrived = self.wire.take(next_s)
        if arrived is not None:
            self._arrived(*arrived)
        return True

    def _arrived(self, at_s: float, source: object, frame: Frame) -> None:
        bits = frame_bits(frame.can_id, frame.data)
        self.bits += bits
        node_id = frame.can_id & 0x7F
        waited_s = at_s - self._offered_s[frame.can_id].pop(0) - bits / self.wire_bitrate
        self.waited_s[frame.can_id] = max(waited_s, self.waited_s.get(frame.can_id, 0.0))
        if frame.can_id & ~0x7F in (SDO_REQUEST_BASE, SDO_RESPONSE_BASE):
            self.chains_s[node_id] = self.chains_s.get(node_id, 0.0) + bits / self.wire_bitrate
        if source is not None:
            self._hear(frame)
        for node in self._roster.listeners(frame):
            if node is not source:
                self._is_received(node, frame, at_s)

    def _is_received(self, node: SimulatedNode, frame: Frame, at_s: float) -> None:
        for answer in node.handle(frame, at_s):
            if answer.can_id & ~0x7F != SDO_RESPONSE_BASE:
                self._offer(node, answer, at_s)
                continue
            self._order += 1
            self.chains_s[node.device.node_id] += self.server_s
            heappush(self._answers, (at_s + self.server_s, self._order, node, answer))
        self._roster.looked_at(node)

"""Index the nodes of one bus by received CAN-IDs and due times, for a constant cost per frame on large buses."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from heapq import heappop, heappush

from dvtcli.domain.ports import Frame
from dvtcli.simulator.network.station import LSS_MASTER, NMT_CAN_ID, SDO_REQUEST, SDO_RESPONSE, SimulatedNode

#: what every node obeys, whatever its state
_NETWORK_IDS = (NMT_CAN_ID, LSS_MASTER)
#: CAN-IDs that are remembered; nobody has more, but a client may try
_MOST_ROUTES = 4096
_NEVER = float("inf")
#: what no node runs at
_NO_RATE = -1


class Roster:
    """Finds the nodes of *nodes* that receive a frame, and those due; call `looked_at` after a receive or poll."""

    def __init__(self, nodes: Sequence[SimulatedNode]) -> None:
        self._nodes = tuple(nodes)
        self._numbers = {node: number for number, node in enumerate(self._nodes)}
        self._breakable = tuple(node for node in self._nodes if node.has_faults)
        #: nodes by node-ID, and receivers by CAN-ID, valid as long as no node's reception changes
        self._by_id: dict[int, tuple[SimulatedNode, ...]] = {}
        self._routes: dict[tuple[int, bool, bool], tuple[SimulatedNode, ...]] = {}
        self._ids: dict[SimulatedNode, int] = {}
        self._hearing: dict[SimulatedNode, int] = {}
        #: the bit rate of each node (bit/s), and the set of bit rates
        self._rate_of: dict[SimulatedNode, int | None] = {}
        self._rates: frozenset[int | None] = frozenset()
        #: the due time of each node, without nodes that are never due
        self._due_s: dict[SimulatedNode, float] = {}
        #: (time, number of the node), including outdated entries
        self._times: list[tuple[float, int]] = []
        #: nodes in whose devices something changed since they were looked at
        self._changed = set(self._nodes)
        for node in self._nodes:
            node.device.on_change(partial(self._changed.add, node))

    @property
    def bus_failed(self) -> bool:
        """True if a fault has killed the bus."""
        return bool(self._breakable) and any(node.bus_failed for node in self._breakable)

    def listeners(self, frame: Frame) -> Sequence[SimulatedNode]:
        """The possible receivers of *frame* in node order, cached by CAN-ID.

        SDO CAN-IDs are restricted by CiA 301: they concern at most one node, never a PDO.
        """
        self._look_at_changed()
        function, node_id = frame.can_id & ~0x7F, frame.can_id & 0x7F
        if function in (SDO_REQUEST, SDO_RESPONSE) and node_id and not frame.extended:
            return self._by_id.get(node_id, ()) if function == SDO_REQUEST else ()
        key = (frame.can_id, frame.extended, frame.remote)
        route = self._routes.get(key)
        if route is None:
            if len(self._routes) >= _MOST_ROUTES:
                self._routes.clear()
            route = self._routes[key] = tuple(node for node in self._nodes if _concerns(node, frame))
        return route

    def are_others_than(self, bit_rate: int | None) -> bool:
        """True if a node runs at another bit rate than *bit_rate* (bit/s)."""
        return not self._rates <= {bit_rate}

    def next_s(self) -> float:
        """The earliest due time of the nodes; infinite for never."""
        self._look_at_changed()
        while self._times:
            due_s, number = self._times[0]
            if self._due_s.get(self._nodes[number]) == due_s:
                return due_s
            heappop(self._times)
        return _NEVER

    def due(self, now_s: float) -> Sequence[SimulatedNode]:
        """The nodes due by *now_s*, in node order."""
        found: set[int] = set()
        while self.next_s() <= now_s:
            found.add(heappop(self._times)[1])
        for number in found:
            del self._due_s[self._nodes[number]]
            self._changed.add(self._nodes[number])  # whether it is polled now or not
        return [self._nodes[number] for number in sorted(found)]

    def looked_at(self, node: SimulatedNode) -> None:
        """Update received CAN-IDs and due time of *node* after a receive or poll."""
        self._changed.discard(node)
        node_id, hearing = node.device.node_id, node.device.services.hearing_changes
        if node_id != self._ids.get(node):
            self._has_id(node, node_id)
        if hearing != self._hearing.get(node):
            self._hearing[node] = hearing
            self._routes.clear()
        if node.bit_rate != self._rate_of.get(node, _NO_RATE):
            self._rate_of[node] = node.bit_rate
            self._rates = frozenset(self._rate_of.values())
        due_s = node.next_poll_s()
        if due_s is None:
            self._due_s.pop(node, None)
        elif self._due_s.get(node) != due_s:
            self._due_s[node] = due_s
            heappush(self._times, (due_s, self._numbers[node]))

    def _has_id(self, node: SimulatedNode, node_id: int) -> None:
        """Index *node* under *node_id* from now on."""
        before, self._ids[node] = self._ids.get(node), node_id
        for changed_id in (node_id,) if before is None else (before, node_id):
            self._by_id[changed_id] = tuple(other for other in self._nodes if self._ids.get(other) == changed_id)
        self._routes.clear()

    def _look_at_changed(self) -> None:
        while self._changed:
            self.looked_at(self._changed.pop())


def _concerns(node: SimulatedNode, frame: Frame) -> bool:
    """True if *frame*, no SDO, may concern *node*."""
    return (frame.can_id in _NETWORK_IDS and not frame.extended) or node.device.services.hears(frame)

"""One simulated node on the network: frames in, frames out, by the pre-defined connection set."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable, Sequence
from functools import partial
from heapq import heappop, heappush
from typing import TYPE_CHECKING

from dvtcli.domain.can_ids import LSS_REQUEST_ID, LSS_RESPONSE_ID, NMT_ID, SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.plant import NEVER, Plant, Source, is_drive
from dvtcli.simulator.device.sdo_server import SdoServer
from dvtcli.simulator.device.strict_device import StrictDevice

if TYPE_CHECKING:
    from dvtcli.simulator.device.faulty import FaultyReply, FaultyServer
    from dvtcli.simulator.device.simulated_faults import Fault
    from dvtcli.simulator.network.signals import SimulatedSignal

#: how long the next frame of a block transfer is waited for (s): a client on a busy computer may take seconds
BLOCK_PATIENCE_S = 10.0


class SimulatedNode:
    """A device with its SDO server, addressed by CAN-ID, and its faults.

    Without *faults* every answer comes at once; with faults some come later, by `poll`.
    """

    def __init__(self, device: StrictDevice, faults: Sequence[Fault] = ()) -> None:
        self.device = device
        self.server = SdoServer(device)
        self._faulty: FaultyServer | None = None
        self._sources: list[Source] = []
        if faults:
            from dvtcli.simulator.device.faulty import FaultyServer
            from dvtcli.simulator.device.simulated_faults import FaultKind

            self._faulty = FaultyServer(self.server, faults)
            if errors := [fault for fault in faults if fault.kind is FaultKind.EMCY]:
                self._sources.append(RaisedErrors(device, errors))
        #: delayed answers with their times
        self._later: deque[tuple[float, Frame]] = deque()
        #: when an SDO request was heard last (s)
        self._asked_s = float("-inf")
        #: until when an LSS master wants silence (s)
        self._quiet_until_s = float("-inf")

    @property
    def has_faults(self) -> bool:
        """True if the node has faults."""
        return self._faulty is not None

    @property
    def bit_rate(self) -> int | None:
        """The node's bit rate (bit/s); None if frames take no time."""
        return self.device.bit_rate

    @property
    def bus_failed(self) -> bool:
        """True if a fault has killed the bus."""
        return self._faulty is not None and self._faulty.bus_failed

    def animate(self, signals: Sequence[SimulatedSignal] = ()) -> None:
        """Start *signals*, and the family's plant for the remaining objects.

        Raises ValueError if the device lacks a number object.
        """
        if signals:
            from dvtcli.simulator.network.signals import SignalSource

            self._sources += [SignalSource(self.device, signal) for signal in signals]
        if self.device.family.plant and is_drive(self.device):
            self._sources.append(Plant(self.device, [(signal.index, signal.sub_index) for signal in signals]))

    def handle(self, frame: Frame, now_s: float = 0.0) -> list[Frame]:
        """The node's immediate answers to *frame* at *now_s* (s, monotonic), in order."""
        if self._dead or now_s < self._quiet_until_s:
            return []
        if not frame.extended and frame.can_id == NMT_ID:
            self._obey(frame)
        elif not frame.extended and frame.can_id == LSS_REQUEST_ID:
            return self._set_layer(frame, now_s)
        elif not frame.extended and frame.can_id == SDO_REQUEST_BASE + self.device.node_id:
            return self._answer(frame, now_s)
        elif self.device.services.hears_sync(frame):
            return self.device.services.sync(frame.data[0] if frame.data else None) + self.device.take_outbox()
        else:
            return self.device.services.receive(frame) + self.device.take_outbox()
        return self.device.take_outbox()

    def poll(self, now_s: float) -> list[Frame]:
        """The frames due at *now_s*, a monotonic time in seconds."""
        if self._dead or now_s < self._quiet_until_s:
            return []
        if self._faulty is not None:
            self._faulty.poll(now_s)
        if self.device.state is not NmtState.INITIALISING:
            for source in self._sources:
                if source.due_s <= now_s:
                    source.poll(now_s)
        due: list[Frame] = []
        while self._later and self._later[0][0] <= now_s:
            due.append(self._later.popleft()[1])
        return due + self.device.take_outbox() + self.device.services.poll(now_s)

    def next_poll_s(self) -> float | None:
        """The time of the next `poll` on the same clock; None for never."""
        due_s = self._next_poll_s()
        return None if due_s is None else max(due_s, self._quiet_until_s)

    def _next_poll_s(self) -> float | None:
        faulty, due_s = self._faulty, self.device.services.next_poll_s()
        if self._sources and self.device.state is not NmtState.INITIALISING:
            soonest_s = min(source.due_s for source in self._sources)
            if soonest_s < NEVER:
                due_s = soonest_s if due_s is None else min(due_s, soonest_s)
        if faulty is None:
            return due_s
        if faulty.dead:
            return None
        for other_s in (self._later[0][0] if self._later else None, faulty.due_s):
            if other_s is not None and (due_s is None or other_s < due_s):
                due_s = other_s
        return due_s

    @property
    def _dead(self) -> bool:
        return self._faulty is not None and self._faulty.dead

    def _obey(self, frame: Frame) -> None:
        if frame.remote or len(frame.data) != 2 or frame.data[1] not in (0, self.device.node_id):
            return
        before = self.device.resets
        self.device.nmt(frame.data[0])
        self._start_over(before)

    def _set_layer(self, frame: Frame, now_s: float) -> list[Frame]:
        """Obey an LSS master."""
        if frame.remote:
            return []
        before, lss = self.device.resets, self.device.lss
        answer = self.device.layer_setting(frame.data)
        self._start_over(before)
        if lss.quiet_ms:
            self._quiet_until_s, lss.quiet_ms = now_s + lss.quiet_ms / 1000, 0
        return ([] if answer is None else [Frame(LSS_RESPONSE_ID, answer)]) + self.device.take_outbox()

    def _start_over(self, before: int) -> None:
        """Drop transfers if the device was reset more often than *before*."""
        if self.device.resets > before:
            self.server.reset()
            self._later.clear()

    def _answer(self, frame: Frame, now_s: float) -> list[Frame]:
        if frame.remote:
            return self.device.take_outbox()
        self._give_up_on_silence(now_s)
        if self._faulty is not None:
            return self._timed(self._faulty.handle(frame.data, now_s), now_s) + self.device.take_outbox()
        response = self.server.handle(frame.data)
        answers = [] if response is None else [Frame(SDO_RESPONSE_BASE + self.device.node_id, response)]
        if self.server.more:
            answers += [Frame(SDO_RESPONSE_BASE + self.device.node_id, each) for each in self.server.take_more()]
        return answers + self.device.take_outbox()

    def _give_up_on_silence(self, now_s: float) -> None:
        """Abort a block transfer whose client is gone, to serve the next client."""
        if now_s - self._asked_s > BLOCK_PATIENCE_S:
            self.server.give_up()
        self._asked_s = now_s

    def _timed(self, answer: FaultyReply, now_s: float) -> list[Frame]:
        """The frames of *answer* due now; a late answer delays the following answers."""
        if self._faulty is not None and self._faulty.boots_at_s is not None:
            self._later.clear()
        frames = [Frame(SDO_RESPONSE_BASE + self.device.node_id, data) for data in answer.frames]
        due_s = max(now_s + answer.delay_s, self._later[-1][0] if self._later else now_s)
        if due_s <= now_s:
            return frames
        self._later.extend((due_s, frame) for frame in frames)
        return []


def stations(
    devices: Sequence[StrictDevice],
    faults: Sequence[Fault] = (),
    signals: Sequence[SimulatedSignal] = (),
    *,
    bit_rate: int | None = None,
    known_rates: Collection[int] | None = (),
) -> list[SimulatedNode]:
    """*devices* as nodes, each with its *faults* and *signals*; items without a node belong to the first.

    *bit_rate* is their bit rate (bit/s), None if frames take no time; *known_rates* are accepted over LSS, None: those
    of CiA 305. Raises ValueError for a signal without its object.
    """
    for device in devices:
        device.run_at(bit_rate, known_rates)
    if not (faults or signals):
        nodes = [SimulatedNode(device) for device in devices]
        for node in nodes:
            node.animate()
        return nodes
    from dvtcli.simulator.device.simulated_faults import own_of

    first = devices[0].node_id if devices else 0
    nodes = [SimulatedNode(device, own_of(device.node_id, first, faults)) for device in devices]
    for node in nodes:
        node.animate(own_of(node.device.node_id, first, signals))
    return nodes


#: what every node obeys, whatever its state
_NETWORK_IDS = (NMT_ID, LSS_REQUEST_ID)
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
        if function in (SDO_REQUEST_BASE, SDO_RESPONSE_BASE) and node_id and not frame.extended:
            return self._by_id.get(node_id, ()) if function == SDO_REQUEST_BASE else ()
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


class RaisedErrors:
    """*faults* of kind `emcy` on *device*, as a `moving.Source`, repeated after each start of the device."""

    def __init__(self, device: StrictDevice, faults: Iterable[Fault]) -> None:
        self._device = device
        self._faults = sorted(faults, key=lambda fault: fault.seconds or 0.0)
        self._waiting: list[tuple[float, int]] = []
        #: the start of the device for the waiting errors
        self._start = -1

    @property
    def due_s(self) -> float:
        """The time of the next error (s); at once after a start, when their times begin."""
        if self._device.services.starts != self._start:
            return -NEVER
        return self._waiting[0][0] if self._waiting else NEVER

    def poll(self, now_s: float) -> None:
        """Raise the errors due at *now_s* (s)."""
        if self._device.services.starts != self._start:
            self._start = self._device.services.starts
            self._waiting = [(now_s + (fault.seconds or 0.0), fault.code or 0) for fault in self._faults]
        while self._waiting and self._waiting[0][0] <= now_s:
            self._device.outbox += self._device.services.emergency(self._waiting.pop(0)[1])

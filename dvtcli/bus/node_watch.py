"""Boot-ups, heartbeats and emergencies of nodes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import BootUp, Emergency, Frame, HeardEmergency, NodeEvent, StateChange

HEARTBEAT = 0x700
#: No node starts twice within this time, in seconds.
TWICE_S = 1.0
EMERGENCY = 0x080
#: command specifiers that begin an SDO download: segmented or expedited, block
_DOWNLOADS = (1, 6)
#: maximum number of remembered error codes per node; the oldest are dropped first
_MOST_CODES = 256


def read_emergency(frame: Frame) -> Emergency | None:
    """The emergency message in *frame*, also if shortened (CiA 301, 7.2.7.3.1); None for another frame."""
    node_id = frame.can_id - EMERGENCY
    if frame.extended or frame.remote or not 2 <= len(frame.data) <= 8 or not 1 <= node_id <= 127:
        return None
    data = frame.data.ljust(8, b"\0")
    return Emergency(node_id, int.from_bytes(data[:2], "little"), data[2], data[3:], frame.timestamp_s)


class NodeWatch:
    """Last message of each node; informs *listeners* about each message."""

    def __init__(self) -> None:
        self.states: dict[int, NmtState] = {}
        self.boot_ups: dict[int, int] = {}
        #: boot-ups without a reset sent from here, and until when (s) a node's next boot-up is expected
        self.restarts: dict[int, int] = {}
        self._ordered_until_s: dict[int, float] = {}
        #: the bus's time in seconds
        self.now_s: Callable[[], float] = lambda: 0.0
        #: when each node that answered nothing since said boot-up last, and how often that was within TWICE_S of the
        #: time before
        self._booted_s: dict[int, float] = {}
        self.double_boot_ups: dict[int, int] = {}
        #: downloads begun by other SDO clients since the node's last boot-up
        self.downloads_of_others: dict[int, int] = {}
        #: number of a node's signs of life (heartbeat or boot-up)
        self.signs_of_life: dict[int, int] = {}
        self.emergencies: dict[int, Emergency] = {}
        #: received error codes, by node-ID and code, latest last
        self.heard_emergencies: dict[int, dict[int, HeardEmergency]] = {}
        self.listeners: list[Callable[[NodeEvent], None]] = []

    def heartbeat(self, frame: Frame) -> bool:
        """Process a heartbeat or boot-up message; whether *frame* was either.

        After its boot-up message a node is in PRE-OPERATIONAL (CiA 301, 7.2.8.3.3); bit 7 is node guarding's toggle
        bit.
        """
        node_id = frame.can_id - HEARTBEAT
        if len(frame.data) != 1 or not 1 <= node_id <= 127:
            return False
        try:
            state = NmtState(frame.data[0] & 0x7F)
        except ValueError:
            return False
        self.signs_of_life[node_id] = self.signs_of_life.get(node_id, 0) + 1
        if state is NmtState.INITIALISING:
            self.boot_ups[node_id] = self.boot_ups.get(node_id, 0) + 1
            if self._ordered_until_s.pop(node_id, -1.0) < self.now_s():
                self.restarts[node_id] = self.restarts.get(node_id, 0) + 1
            self.downloads_of_others[node_id] = 0
            self._count_double(node_id, frame.timestamp_s)
            self._tell(BootUp(node_id, frame.timestamp_s))
            state = NmtState.PRE_OPERATIONAL
        before = self.states.get(node_id)
        self.states[node_id] = state
        if before is not state:
            self._tell(StateChange(node_id, before, state, frame.timestamp_s))
        return True

    def answered(self, node_id: int) -> None:
        """Note an SDO answer of *node_id*: its next boot-up is a restart, not a second node's start."""
        self._booted_s.pop(node_id, None)

    def request_of_another(self, frame: Frame) -> None:
        """Process an SDO request of another client; a download is counted (CiA 301, 7.2.4.3)."""
        node_id = frame.can_id & 0x7F
        if frame.data and frame.data[0] >> 5 in _DOWNLOADS:
            self.downloads_of_others[node_id] = self.downloads_of_others.get(node_id, 0) + 1

    def _count_double(self, node_id: int, now_s: float) -> None:
        """Count a boot-up right after another; not without timestamps: waiting frames would seem simultaneous."""
        before_s = self._booted_s.get(node_id)
        if now_s and before_s is not None and 0 <= now_s - before_s < TWICE_S:
            self.double_boot_ups[node_id] = self.double_boot_ups.get(node_id, 0) + 1
        if now_s:
            self._booted_s[node_id] = now_s

    def emergency(self, frame: Frame) -> bool:
        """Process an emergency message, also if shortened; False for another frame."""
        said = read_emergency(frame)
        if said is None:
            return False
        self.emergencies[said.node_id] = said
        self._count_emergency(said)
        self._tell(said)
        return True

    def _count_emergency(self, said: Emergency) -> None:
        heard = self.heard_emergencies.setdefault(said.node_id, {})
        before = heard.pop(said.code, None)
        count, first_s = (0, said.timestamp_s) if before is None else (before.count, before.first_s)
        heard[said.code] = HeardEmergency(count + 1, first_s, said)
        if len(heard) > _MOST_CODES:
            del heard[next(iter(heard))]

    def forget_state(self, node_id: int) -> None:
        """Forget the state of *node_id* (0: all) after a command to it."""
        if node_id == 0:
            self.states.clear()
        else:
            self.states.pop(node_id, None)

    def order_restart(self, node_id: int, within_s: float) -> None:
        """Expect a restart of *node_id* (0: all nodes) within *within_s* seconds."""
        for restarting_id in range(1, 128) if node_id == 0 else (node_id,):
            self._ordered_until_s[restarting_id] = self.now_s() + within_s

    def _tell(self, event: NodeEvent) -> None:
        for listener in tuple(self.listeners):
            listener(event)


class HeardNodes(ABC):
    """A bus with the messages of its nodes since it was opened."""

    def __init__(self) -> None:
        self._watch = NodeWatch()

    def nmt_state(self, node_id: int, timeout_s: float = 0.0) -> NmtState | None:
        """The last received state of *node_id* since its last NMT command; waits up to *timeout_s* for a *new* state.

        None: no state was received. After a boot-up a node is PRE-OPERATIONAL (CiA 301, 7.2.8.3.3).
        """
        self.drain()
        signs = self._watch.signs_of_life
        seen = signs.get(node_id, 0)
        if timeout_s > 0:
            self._wait_for(lambda: signs.get(node_id, 0) > seen, timeout_s)
        return self._watch.states.get(node_id)

    def boot_ups(self, node_id: int) -> int:
        """See `CanopenBus.boot_ups`."""
        self.drain()
        return self._watch.boot_ups.get(node_id, 0)

    def restarts(self, node_id: int) -> int:
        """See `CanopenBus.restarts`."""
        self.drain()
        return self._watch.restarts.get(node_id, 0)

    def order_restart(self, node_id: int, within_s: float) -> None:
        """See `CanopenBus.order_restart`."""
        self.drain()
        self._watch.order_restart(node_id, within_s)

    def upsets(self, node_id: int) -> int:
        """See `CanopenBus.upsets`."""
        return self.boot_ups(node_id) + self._repeated(node_id)

    def downloads_of_others(self, node_id: int) -> int:
        """See `CanopenBus.downloads_of_others`."""
        self.drain()
        return self._watch.downloads_of_others.get(node_id, 0)

    def happened(self, node_id: int) -> tuple[int, int]:
        """See `CanopenBus.happened`."""
        return (
            self._watch.boot_ups.get(node_id, 0) + self._repeated(node_id),
            self._watch.downloads_of_others.get(node_id, 0),
        )

    def wait_boot_up(self, node_id: int, seen: int, timeout_s: float) -> bool:
        """See `CanopenBus.wait_boot_up`."""
        return self._wait_for(lambda: self._watch.boot_ups.get(node_id, 0) > seen, timeout_s)

    def heard_nodes(self) -> dict[int, NmtState]:
        """See `CanopenBus.heard_nodes`."""
        self.drain()
        return dict(self._watch.states)

    def emergency(self, node_id: int) -> Emergency | None:
        """See `CanopenBus.emergency`."""
        self.drain()
        return self._watch.emergencies.get(node_id)

    def heard_emergencies(self, node_id: int) -> tuple[HeardEmergency, ...]:
        """See `CanopenBus.heard_emergencies`."""
        self.drain()
        return tuple(reversed(self._watch.heard_emergencies.get(node_id, {}).values()))

    def on_event(self, callback: Callable[[NodeEvent], None]) -> Callable[[], None]:
        """See `CanopenBus.on_event`."""
        self._watch.listeners.append(callback)
        return lambda: self._watch.listeners.remove(callback)

    @abstractmethod
    def drain(self) -> None:
        """Process received frames without waiting."""

    @abstractmethod
    def _wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until *condition* holds, usually by a heartbeat or boot-up; whether it holds after *timeout_s*."""

    def _repeated(self, _node_id: int) -> int:
        """Number of repeated uploads of a node so far."""
        return 0

"""Boot-ups, heartbeats and emergencies of nodes, and signs of a second SDO client or of two nodes with one node-ID."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from time import monotonic

from dvtcli.bus.sdo.sdo_link import DroppedAnswers
from dvtcli.domain.can_ids import EMCY_BASE, HEARTBEAT_BASE
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import BootUp, Emergency, Frame, NodeEvent, ReceivedEmergency, StateChange

#: No node starts twice within this time, in seconds.
TWICE_S = 1.0
#: command specifiers that begin an SDO download: segmented or expedited, block
_DOWNLOADS = (1, 6)
#: maximum number of remembered error codes per node; the oldest are dropped first
_MOST_CODES = 256


def read_emergency(frame: Frame) -> Emergency | None:
    """The emergency message in *frame*, also if shortened (CiA 301, 7.2.7.3.1); None for another frame."""
    node_id = frame.can_id - EMCY_BASE
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
        self.received_emergencies: dict[int, dict[int, ReceivedEmergency]] = {}
        self.listeners: list[Callable[[NodeEvent], None]] = []

    def heartbeat(self, frame: Frame) -> bool:
        """Process a heartbeat or boot-up message; whether *frame* was either.

        After its boot-up message a node is in PRE-OPERATIONAL (CiA 301, 7.2.8.3.3); bit 7 is node guarding's toggle
        bit.
        """
        node_id = frame.can_id - HEARTBEAT_BASE
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
        received = self.received_emergencies.setdefault(said.node_id, {})
        before = received.pop(said.code, None)
        count, first_s = (0, said.timestamp_s) if before is None else (before.count, before.first_s)
        received[said.code] = ReceivedEmergency(count + 1, first_s, said)
        if len(received) > _MOST_CODES:
            del received[next(iter(received))]

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


#: A single doubled answer may come from the bus; this many mean a second node.
SECOND_ANSWERS = 3
#: Time after a reset during which boot-ups count as its answers, in seconds.
_RESETTING_S = 5.0


@dataclass(slots=True, eq=False, repr=False)
class Oddities:
    """Signs already reported, so that each is reported once; *now_s* returns the bus's time in seconds."""

    now_s: Callable[[], float] = monotonic
    _dropped: dict[int, DroppedAnswers] = field(default_factory=dict)
    _boot_ups: Counter[int] = field(default_factory=Counter)
    _resets: Counter[int] = field(default_factory=Counter)
    _doubled: Counter[int] = field(default_factory=Counter)
    _double_boot_ups: Counter[int] = field(default_factory=Counter)
    _reset_s: dict[int, float] = field(default_factory=dict)

    def commanded(self, command: NmtCommand, node_id: int, boot_ups: Mapping[int, int]) -> None:
        """Note any master's NMT command: after a reset a boot-up of *node_id* (0: all) is expected.

        *boot_ups* were received before and do not answer it.
        """
        if command.is_reset:
            if not self._resets:
                self._boot_ups = Counter(boot_ups)
            elif not (self._resets[node_id] or self._resets[0]):
                self._boot_ups[node_id] = boot_ups.get(node_id, 0)
            self._resets[node_id] += 1
            self._reset_s[node_id] = self.now_s()

    def news(
        self, dropped: Mapping[int, DroppedAnswers], boot_ups: Mapping[int, int], double_boot_ups: Mapping[int, int]
    ) -> list[str]:
        """News since the last call, in words; *double_boot_ups* came right after another boot-up."""
        found = [text for node_id, now in dropped.items() for text in self._of_channel(node_id, now)]
        found += [text for node_id, count in dict(boot_ups).items() for text in self._of_boot_ups(node_id, count)]
        found += [text for node_id, count in dict(double_boot_ups).items() for text in self._of_doubles(node_id, count)]
        self._resets.clear()
        return found

    def _of_channel(self, node_id: int, now: DroppedAnswers) -> Iterator[str]:
        before = self._dropped.get(node_id)
        self._dropped[node_id] = replace(now)
        others = now.other_client - (before.other_client if before else 0)
        if others > 0:
            yield (
                f"another SDO client communicates with node {node_id}: {others} frames on its SDO channel were not "
                f"ours; it may be another dvtcli, even if that only monitors"
            )
            self._doubled[node_id] = now.doubled  # answers to the other client may look like duplicates
        doubled = now.doubled - self._doubled[node_id]
        if doubled >= SECOND_ANSWERS:
            self._doubled[node_id] = now.doubled
            yield f"{doubled} answers were received twice: there may be two nodes with node-ID {node_id}"

    def _of_boot_ups(self, node_id: int, count: int) -> Iterator[str]:
        new = count - self._boot_ups[node_id]
        self._boot_ups[node_id] = count
        expected = self._resets[node_id] + self._resets[0]
        if expected and new > expected:
            yield (
                f"{new} boot-ups after {expected} reset{'' if expected == 1 else 's'}: are there two nodes with "
                f"node-ID {node_id}, or does it restart by itself?"
            )

    def _of_doubles(self, node_id: int, count: int) -> Iterator[str]:
        new = count - self._double_boot_ups[node_id]
        self._double_boot_ups[node_id] = count
        reset_s = max((self._reset_s[key] for key in (0, node_id) if key in self._reset_s), default=None)
        if new > 0 and (reset_s is None or self.now_s() - reset_s > _RESETTING_S):
            yield (
                f"two boot-ups within a second, and no reset was seen: are there two nodes with node-ID {node_id}, "
                "or does it restart by itself?"
            )

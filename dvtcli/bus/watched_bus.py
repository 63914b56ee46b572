"""Common part of every bus: check node-IDs, remember node messages.

A transport adds SDO access, frames or commands, and waiting.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from math import inf
from threading import Lock
from typing import TYPE_CHECKING

from dvtcli.bus.node_watch import NodeWatch, Oddities
from dvtcli.bus.receiver import Tap
from dvtcli.bus.sdo.sdo_link import DEFAULT_RETRIES, DEFAULT_TIMEOUT_S, DroppedAnswers, Inbox, SdoSettings
from dvtcli.bus.turns import Turns, one_by_one
from dvtcli.domain.can_ids import LSS_REQUEST_ID, NMT_ID
from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.nmt import UNCONFIGURED, NmtCommand, NmtState
from dvtcli.domain.ports import Emergency, Frame, NodeEvent, ReceivedEmergency, SdoTransport
from dvtcli.errors import BusUnavailable, SafetyRefusal, UsageError

if TYPE_CHECKING:
    from dvtcli.bus.bus_share import PaceLimiter, ShareLimiter


def act_of(frame: Frame) -> str | None:
    """Effect of *frame* on nodes in words, None if it only asks."""
    if frame.remote:
        return None
    if frame.can_id == LSS_REQUEST_ID:
        from dvtcli.domain.lss_services import CHANGES

        return CHANGES.get(frame.data[0]) if frame.data else None
    if frame.can_id == NMT_ID and len(frame.data) == 2 and frame.data[0] in list(NmtCommand):
        return command_text(NmtCommand(frame.data[0]), frame.data[1])
    return f"frame {can_id_text(frame.can_id, extended=frame.extended)}"


def command_text(command: NmtCommand, node_id: int) -> str:
    """An NMT *command* to *node_id*, or to all nodes with 0."""
    return f"NMT {command.word} to {f'node {node_id}' if node_id else 'all nodes'}"


#: time after a sent reset during which a boot-up counts as its answer (s)
RESTART_S = 10.0

#: maximum load (%) with dvtcli's frames while a machine may be running
DEFAULT_SHARE_PERCENT = 50


class WatchedBus(ABC):
    """The common part of every CanopenBus, called *name* on screens.

    *timeout_s* (s) and *retries* (0..) are those of `SdoSettings`; *bitrate* is in bit/s, None if unknown.
    """

    def __init__(
        self,
        name: str,
        *,
        simulated: bool = False,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        retries: int = DEFAULT_RETRIES,
        bitrate: int | None = None,
    ) -> None:
        #: name of the bus on screens, for example `socketcan:can0`
        self.name = name
        #: whether no frame leaves this process
        self.simulated = simulated
        #: bit/s, None if unknown
        self.bitrate = bitrate
        #: pace (bit/s) of parallel requests if the bit rate is unknown; None for no parallel requests
        self.unknown_pace: int | None = None
        self.settings = SdoSettings(timeout_s, retries)
        self._watch = NodeWatch()
        self._watch.now_s = self.now_s
        self._turns: Turns | None = None
        self._percent = DEFAULT_SHARE_PERCENT
        #: the load limiter, once a machine may run
        self._share: ShareLimiter | None = None
        self._share_lock = Lock()
        #: present SDO transfers by their channel's lock, and their pace once there are several
        self._transfers: set[Lock] = set()
        self._pace: PaceLimiter | None = None
        #: 0x1016 entries known to be non-zero, by node-ID and sub-index
        self._consumers: set[tuple[int, int]] = set()
        self._oddities = Oddities(self.now_s)
        #: sent frames with an effect on nodes, in words, and their number
        self._acts: dict[str, int] = {}

    def sdo(self, node_id: int) -> SdoTransport:
        """See `CanopenBus.sdo`."""
        if not 1 <= node_id <= 127:
            raise UsageError(f"node-ID {node_id} is outside 1..127")
        return self._channel(node_id)

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

    def disturbance_count(self, node_id: int) -> int:
        """See `CanopenBus.disturbance_count`."""
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

    def nodes_seen(self) -> dict[int, NmtState]:
        """See `CanopenBus.nodes_seen`."""
        self.drain()
        return dict(self._watch.states)

    def emergency(self, node_id: int) -> Emergency | None:
        """See `CanopenBus.emergency`."""
        self.drain()
        return self._watch.emergencies.get(node_id)

    def received_emergencies(self, node_id: int) -> tuple[ReceivedEmergency, ...]:
        """See `CanopenBus.received_emergencies`."""
        self.drain()
        return tuple(reversed(self._watch.received_emergencies.get(node_id, {}).values()))

    def on_event(self, callback: Callable[[NodeEvent], None]) -> Callable[[], None]:
        """See `CanopenBus.on_event`."""
        self._watch.listeners.append(callback)
        return lambda: self._watch.listeners.remove(callback)

    def side_by_side(self, jobs: Sequence[Callable[[], None]]) -> list[BaseException]:
        """See `CanopenBus.side_by_side`."""
        if len(jobs) < 2 or self._turns is not None or not self.carries_frames:
            return one_by_one(jobs)
        self.drain()
        self._turns = turns = Turns(jobs, self._most_at_once, self._until, self.now_s)
        try:
            turns.run()
        finally:
            self._turns = None
        return turns.faults

    def read_at_once(self) -> None:  # noqa: B027 - only simulated buses can
        """Read objects of simulated nodes without frames from now on; real nodes are read as before."""

    def begin_transfer(self, turn: Lock) -> None:
        """Take *turn*, which a waiting thread may hold (SdoLink)."""
        while not turn.acquire(blocking=False):
            if not self._gave_turn(lambda: not turn.locked(), inf):
                turn.acquire()
                break
        self._transfers.add(turn)

    def end_transfer(self, turn: Lock) -> None:
        """Give *turn* back (SdoLink)."""
        self._transfers.discard(turn)
        turn.release()
        if self._pace is not None and not self._transfers:
            self._pace.rest()

    def _most_at_once(self) -> int:
        """Number of nodes to ask at once, according to the frames read so far."""
        return 1

    def _until(self, ready: Callable[[], bool], deadline_s: float) -> None:
        """Read until *ready*, usually by a received frame, or *deadline_s* (of `now_s`)."""
        raise NotImplementedError

    def _gave_turn(self, ready: Callable[[], bool], deadline_s: float) -> bool:
        """If this thread is a job in turns, let others continue until *ready*, or *deadline_s*."""
        turns = self._turns
        if turns is None or not turns.mine():
            return False
        turns.wait(ready, deadline_s)
        return True

    def _gave_turn_until(self, deadline_s: float) -> bool:
        """The same until *deadline_s*, whatever happens."""
        turns = self._turns
        if turns is None or not turns.mine():
            return False
        turns.wait_until(deadline_s)
        return True

    def _gave_turn_for(self, inbox: Inbox, deadline_s: float) -> bool:
        """The same until something is in *inbox*."""
        turns = self._turns
        if turns is None or not turns.mine():
            return False
        turns.wait_for(inbox, deadline_s)
        return True

    def set_timeout(self, timeout_s: float) -> None:
        """See `CanopenBus.set_timeout`."""
        self.settings.timeout_s = timeout_s

    def set_bus_share(self, percent: int | None) -> None:
        """See `CanopenBus.set_bus_share`."""
        self._percent = percent or DEFAULT_SHARE_PERCENT

    def await_share(self) -> None:
        """Wait until an SDO exchange keeps the load within the share (SdoLink), 1 s at most.

        Only with a known bit rate: several transfers at once may use all but a few gaps, and a smaller
        share applies while a node is OPERATIONAL, or a node monitors another's heartbeat (0x1016).
        """
        if self.bitrate is not None and (self._share or self._may_run()):
            self._keep_share(self.bitrate)
        if len(self._transfers) > 1 and (pace := self.bitrate or self.unknown_pace):
            self._keep_pace(pace)

    def _keep_share(self, bit_rate: int) -> None:
        """Wait until an exchange keeps the load within the share for a running machine."""
        with self._share_lock:
            if self._share is None:
                from dvtcli.bus.bus_share import ShareLimiter

                self._share = ShareLimiter(self, bit_rate)
        percent = self._percent if self._percent < 100 and self._may_run() else 0
        if percent:
            self.drain()
        self._share.wait(percent)

    def _keep_pace(self, bit_rate: int) -> None:
        """Wait until a parallel request may go."""
        with self._share_lock:
            if self._pace is None:
                from dvtcli.bus.bus_share import PaceLimiter

                self._pace = PaceLimiter(self)
        self._pace.wait(bit_rate)

    def delay_s(self, *, anew: bool) -> float:  # noqa: ARG002 - as SdoLink has it
        """Always 0, see `SdoLink.delay_s`."""
        return 0.0

    def takes_bursts(self) -> bool:
        """Whether the bus may be filled for a moment (SdoLink): nothing runs, or the whole bus is permitted."""
        return self._percent >= 100 or not self._may_run()

    def is_stopped(self, node_id: int) -> bool:
        """See `SdoLink.is_stopped`."""
        return self._watch.states.get(node_id) is NmtState.STOPPED

    def consumes_heartbeat(self, node_id: int, sub_index: int, *, consumes: bool) -> None:
        """See `SdoLink.consumes_heartbeat`."""
        (self._consumers.add if consumes else self._consumers.discard)((node_id, sub_index))

    def _may_run(self) -> bool:
        """Whether SDO at full speed could stop a machine by keeping PDOs or heartbeats off the bus."""
        return bool(self._consumers) or NmtState.OPERATIONAL in self._watch.states.values()

    def send_nmt(self, command: NmtCommand, node_id: int) -> None:
        """Send an NMT command to *node_id*, or to all nodes with 0; their known states are forgotten.

        255 are the nodes without node-ID (CiA 305).
        """
        if not (0 <= node_id <= 127 or node_id == UNCONFIGURED):
            raise UsageError(f"node-ID {node_id} is outside 0..127")
        self.drain()
        self._watch.forget_state(node_id)
        if command.is_reset:
            self._watch.order_restart(node_id, RESTART_S)
        self._oddities.commanded(command, node_id, self._watch.boot_ups)
        if not self.carries_frames:  # otherwise its frame is noted
            self.note_act(command_text(command, node_id))
        self._command(command, node_id)

    def acts(self) -> list[str]:
        """See `CanopenBus.acts`."""
        acts, self._acts = self._acts, {}
        return [text if count == 1 else f"{text} ({count} times)" for text, count in acts.items()]

    def note_act(self, text: str | None) -> None:
        """Note that *text* is about to be sent (SdoLink); None has no effect on nodes."""
        if text is not None:
            self._acts[text] = self._acts.get(text, 0) + 1

    def disturbances(self) -> list[str]:
        """Disturbances since the last call: another SDO client, two nodes with one node-ID."""
        with suppress(BusUnavailable):  # the users of a failed bus got the error
            self.drain()
        return self._oddities.news(self._dropped(), self._watch.boot_ups, self._watch.double_boot_ups)

    def error_frame_count(self) -> int:
        """Always 0: error frames are not recognised."""
        return 0

    def lost_frame_count(self) -> int:
        """Always 0: losses are unknown."""
        return 0

    @property
    def runs_at(self) -> int | None:
        """The bit rate (bit/s), None if unknown."""
        return self.bitrate

    def require_settable(self, bit_rate: int, *, listen_only: bool = False) -> None:  # noqa: ARG002 - of no bit rate
        """Raise SafetyRefusal: bit rates cannot be set, unless a transport overrides this."""
        raise SafetyRefusal(
            f"the bit rate of {self.name} cannot be set from here", hint="a CAN adapter of this machine lets it be set"
        )

    def set_bit_rate(self, bit_rate: int, *, listen_only: bool = False) -> None:
        """Raise SafetyRefusal: bit rates cannot be set, unless a transport overrides this."""
        self.require_settable(bit_rate, listen_only=listen_only)

    @property
    def carries_frames(self) -> bool:
        """Whether CAN frames are sent and received; False unless a transport overrides this."""
        return False

    @property
    def carries_remote_frames(self) -> bool:
        """Whether `send` can send a remote frame."""
        return False

    def exchanged(self) -> list[tuple[Frame, bool]]:
        """The last frames sent from here and their answers; empty unless a transport records them."""
        return []

    @abstractmethod
    def drain(self) -> None:
        """Process received frames without waiting."""

    @abstractmethod
    def _wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until *condition* holds, usually by a heartbeat or boot-up; whether it holds after *timeout_s*."""

    def _repeated(self, _node_id: int) -> int:
        """Number of repeated uploads of a node so far."""
        return 0

    @abstractmethod
    def tap(self, callback: Tap) -> Callable[[], None]:
        """Call *callback*(frame, sent) for each frame received or sent; returns a function that ends it.

        See `on_event`.
        """

    def send(self, frame: Frame) -> None:
        """Send a frame (SYNC, a PDO). Raises UsageError if the bus carries no frames."""
        raise UsageError(
            f"{self.name} carries no CAN frames: {can_id_text(frame.can_id, extended=frame.extended)} cannot be sent",
            hint="it reads and writes objects, and commands NMT states; an interface of this machine carries frames",
        )

    @abstractmethod
    def receive(self, duration_s: float) -> Iterator[Frame]:
        """See `CanopenBus.receive`."""

    @abstractmethod
    def idle(self, duration_s: float) -> None:
        """See `CanopenBus.idle`."""

    @abstractmethod
    def now_s(self) -> float:
        """See `CanopenBus.now_s`."""

    @abstractmethod
    def sleep(self, duration_s: float) -> None:
        """See `CanopenBus.sleep`."""

    @abstractmethod
    def close(self) -> None:
        """See `CanopenBus.close`."""

    @abstractmethod
    def _channel(self, node_id: int) -> SdoTransport:
        """The default SDO channel of *node_id* (1..127); always the same object for the same node."""

    def _command(self, command: NmtCommand, node_id: int) -> None:
        """Send an NMT command, as a frame if frames are carried (CiA 301, 7.2.8.3.1)."""
        self.send(Frame(NMT_ID, bytes([command, node_id])))

    def _received_command(self, data: bytes) -> None:
        """Process another master's NMT command (a second dvtcli, for example): known states become invalid.

        A boot-up after its reset is expected.
        """
        if len(data) == 2 and data[0] in list(NmtCommand) and data[1] <= 127:
            self._watch.forget_state(data[1])
            self._oddities.commanded(NmtCommand(data[0]), data[1], self._watch.boot_ups)

    def _dropped(self) -> Mapping[int, DroppedAnswers]:
        """Number of discarded answers so far, by node-ID."""
        return {}

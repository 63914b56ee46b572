"""A bus whose messages are read one at a time; if they are CAN frames, SDO runs over them, and NMT is recognised."""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections.abc import Callable, Iterator
from queue import SimpleQueue
from time import monotonic
from typing import Generic, TypeVar
from weakref import WeakSet

from dvtcli.bus.receiver import Receiver, Tap, Traffic, Wake
from dvtcli.bus.sdo.client import SdoChannel, StrictSdoClient
from dvtcli.bus.sdo.sdo_link import (
    DEFAULT_RETRIES,
    DEFAULT_TIMEOUT_S,
    RESTARTED,
    DroppedAnswers,
    Inbox,
    SdoLink,
    SdoSettings,
)
from dvtcli.bus.watched_bus import WatchedBus, act_of
from dvtcli.domain.can_ids import (
    EMCY_BASE,
    HEARTBEAT_BASE,
    LSS_RESPONSE_ID,
    NMT_ID,
    SDO_REQUEST_BASE,
    SDO_RESPONSE_BASE,
)
from dvtcli.domain.cob_id import fits
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import Frame, SdoTransport
from dvtcli.errors import BusUnavailable, UsageError

M = TypeVar("M")


def _inside(inbox: SimpleQueue[Frame | Wake]) -> Iterator[Frame]:
    """The frames in *inbox* now, without later frames."""
    for _ in range(inbox.qsize()):
        frame = inbox.get_nowait()
        if not isinstance(frame, Wake):
            yield frame


class _Ready(SimpleQueue[bool | Wake]):
    """An inbox with an item as soon as *ready*, regardless of the delivery."""

    def __init__(self, ready: Callable[[], bool]) -> None:
        self._ready = ready

    def empty(self) -> bool:
        """Whether nothing is ready, and no note of the receiver is here."""
        return super().empty() and not self._ready()

    def get_nowait(self) -> bool | Wake:
        """The receiver's note, else True for ready."""
        return True if super().empty() else super().get_nowait()


class SdoChannels:
    """The channels over *link*; all share *settings*."""

    def __init__(self, link: SdoLink, settings: SdoSettings) -> None:
        self._link = link
        self._settings = settings
        self._lock = threading.Lock()
        self._clients: dict[int, StrictSdoClient] = {}
        self._channels: dict[int, SdoChannel] = {}

    def channel(self, node_id: int) -> SdoChannel:
        """The channel of *node_id*; always the same object for the same node."""
        if node_id not in self._channels:
            with self._lock:
                if node_id not in self._channels:
                    client = self._clients[node_id] = StrictSdoClient(node_id, self._link, self._settings)
                    self._channels[node_id] = SdoChannel(client)
        return self._channels[node_id]

    def receive(self, node_id: int, can_id: int, data: bytes, *, extended: bool) -> None:
        """Process a frame of *node_id*'s channel, a request or an answer."""
        client = self._clients.get(node_id)
        if client is not None:
            client.receive(can_id, data, extended=extended)

    def restarted(self, node_id: int) -> None:
        """Process a boot-up of *node_id*: earlier requests are lost."""
        client = self._clients.get(node_id)
        if client is not None:
            client.inbox.put(RESTARTED)

    def repeated(self, node_id: int) -> int:
        """Number of repeated uploads of *node_id* so far."""
        client = self._clients.get(node_id)
        return 0 if client is None else client.repeated

    def dropped(self) -> dict[int, DroppedAnswers]:
        """Number of discarded answers so far, by node-ID."""
        return {node_id: channel.dropped for node_id, channel in dict(self._channels).items()}


_SDO_IDS = (SDO_RESPONSE_BASE, SDO_REQUEST_BASE)

#: number of nodes asked at once if nothing runs: enough to use the wire with servers that take 10 ms
MOST_AT_ONCE = 64
#: the same if the bit rate is unknown
FEW_AT_ONCE = 8
#: time without PDOs after which nothing runs on the bus (s)
QUIET_S = 10.0


class MessageBus(WatchedBus, Generic[M]):
    """A `WatchedBus` whose messages are read one at a time; *frame_of* converts a message to a frame.

    With *carries_frames* the messages are CAN frames: a subclass has `_send`, and its `_deliver` hands data frames to
    `_understand`. Without, as behind a gateway, it has a `_channel` and a `_command` of its own.
    """

    def __init__(
        self,
        name: str,
        frame_of: Callable[[M], Frame],
        *,
        carries_frames: bool = True,
        simulated: bool = False,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        retries: int = DEFAULT_RETRIES,
        bitrate: int | None = None,
    ) -> None:
        super().__init__(name, simulated=simulated, timeout_s=timeout_s, retries=retries, bitrate=bitrate)
        self._receiver: Receiver[M] = Receiver(self._read_or_fail, self._deliver)
        self._traffic: Traffic[M] = Traffic(frame_of, self.now_s)
        self._frame_of = frame_of
        self._carries_frames = carries_frames
        self._sdo_channels = SdoChannels(self, self.settings)
        #: time of the last PDO
        self._pdo_s = float("-inf")
        self._life_waiters: WeakSet[SimpleQueue[bool | Wake]] = WeakSet()
        self._close_lock = threading.Lock()
        self._closed = False
        #: the bus's first failure in any thread: some drivers report it only once
        self._failure: BusUnavailable | None = None

    def tap(self, callback: Tap) -> Callable[[], None]:
        """Call *callback*(frame, sent) for each frame received or sent; returns a function that ends it.

        See `on_event`.
        """
        return self._traffic.tap(callback)

    def exchanged(self) -> list[tuple[Frame, bool]]:
        """See `CanopenBus.exchanged`."""
        return self._traffic.exchanged()

    def receive(self, duration_s: float) -> Iterator[Frame]:
        """Yield every frame received within *duration_s* of this call, and frames since the last `send`."""
        self._receiver.drain()
        inbox = self._traffic.listen()
        return self._frames(inbox, monotonic() + duration_s)

    def idle(self, duration_s: float) -> None:
        """Read the bus for *duration_s* for the callbacks, as a background thread does in a loop.

        Gives way to any waiting thread. Raises BusUnavailable after a failure in any thread, or if the bus was closed.
        """
        if self._failure is not None:
            failure = self._failure
            raise BusUnavailable(failure.text, why=failure.why, hint=failure.hint)
        self._receiver.idle(duration_s)

    def now_s(self) -> float:
        """Time base of deadlines in seconds (time.monotonic)."""
        return monotonic()

    def delay_s(self, *, anew: bool) -> float:
        """See `SdoLink.delay_s`."""
        return self._receiver.delay_s(anew=anew and len(self._transfers) < 2)

    def sleep(self, duration_s: float) -> None:
        """Wait *duration_s*, reading the bus meanwhile unless another thread does. Raises BusUnavailable."""
        if duration_s > 0 and not self._gave_turn_until(monotonic() + duration_s):
            self._receiver.idle(duration_s)

    def take(self, inbox: Inbox, deadline_s: float) -> bytes | None:
        """Wait for an item of `_deliver` in *inbox* until *deadline_s* (of `now_s`); None if none came."""
        if self._turns is not None and self._gave_turn_for(inbox, deadline_s):
            item = None if inbox.empty() else inbox.get_nowait()
            return None if isinstance(item, Wake) else item
        return self._receiver.take(inbox, deadline_s)

    def drain(self) -> None:
        """Deliver received frames without waiting."""
        self._receiver.drain()

    def close(self) -> None:
        """Leave the bus, within some 20 ms; waiting threads get BusUnavailable. May be called twice."""
        with self._close_lock:
            if self._closed:
                return
            self._closed = True
        self._receiver.close()
        self._leave()

    @abstractmethod
    def _read(self, wait_s: float) -> M | None:
        """The next message, None if none came within *wait_s*. Raises BusUnavailable if the bus failed."""

    @abstractmethod
    def _deliver(self, message: M) -> None:
        """Deliver *message* to its receivers and observers."""

    @abstractmethod
    def _leave(self) -> None:
        """Release the underlying connection; called once."""

    def _read_or_fail(self, wait_s: float) -> M | None:
        try:
            return self._read(wait_s)
        except BusUnavailable as failure:
            self._failure = failure
            self._receiver.fail(failure)  # all other waiting threads
            raise

    def _heartbeat(self, frame: Frame) -> None:
        """Process a heartbeat or boot-up message, and wake threads that wait for it."""
        if self._watch.heartbeat(frame):
            for waiter in tuple(self._life_waiters):
                waiter.put(True)

    def _frames(self, inbox: SimpleQueue[Frame | Wake], deadline_s: float) -> Iterator[Frame]:
        """Frames until *deadline_s*, and received frames at this moment, once: a bus may never be quiet."""
        while monotonic() < deadline_s:
            frame = self._receiver.take(inbox, deadline_s)
            if frame is None:
                return
            yield frame
        yield from _inside(inbox)
        self._until(lambda: False, deadline_s)
        yield from _inside(inbox)

    def _wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until *condition* holds, usually by a heartbeat or boot-up."""
        deadline_s = monotonic() + timeout_s
        if self._gave_turn(condition, deadline_s):
            return condition()
        inbox: SimpleQueue[bool | Wake] = SimpleQueue()
        self._life_waiters.add(inbox)
        self._receiver.drain()
        while not condition():
            if self._receiver.take(inbox, deadline_s) is None:
                return condition()
        return True

    def _until(self, ready: Callable[[], bool], deadline_s: float) -> None:
        """Read until *ready*, or *deadline_s*: frames received by then are read."""
        self._receiver.take(_Ready(ready), deadline_s)

    @property
    def carries_frames(self) -> bool:
        """Whether the messages are CAN frames."""
        return self._carries_frames

    @property
    def carries_remote_frames(self) -> bool:
        """Whether a remote frame can be sent."""
        return self._carries_frames

    def send(self, frame: Frame) -> None:
        """Send a frame (SYNC, a PDO); answers are kept for a `receive` within the next second.

        Raises UsageError if the bus carries no frames, or the CAN-ID does not fit: drivers cut off its bits, and 0x800
        would be an NMT command.
        """
        if not self._carries_frames:
            super().send(frame)
        if not fits(frame.can_id, extended=frame.extended):
            raise UsageError(f"CAN-ID 0x{frame.can_id:X} has more than {29 if frame.extended else 11} bits: not sent")
        self.drain()
        self.note_act(act_of(frame))
        self._traffic.keep_answers()
        self._send(frame.can_id, frame.data, extended=frame.extended, remote=frame.remote, dlc=frame.dlc)

    def send_sdo(self, can_id: int, data: bytes) -> None:
        """Send an SDO frame (SdoLink)."""
        self._send(can_id, data)

    def _send(self, can_id: int, data: bytes, *, extended: bool = False, remote: bool = False, dlc: int = 0) -> None:
        """Send a frame (*dlc* for a remote frame only), and inform observers. Raises BusUnavailable.

        Without a subclass's own the bus carries no frames: UsageError.
        """
        super().send(Frame(can_id, data, extended, remote, dlc=dlc))

    def _most_at_once(self) -> int:
        """1 while a machine may be running, or if the bit rate and the pace are unknown.

        SDO at full speed would keep heartbeats off the bus: with a known bit rate its pace is limited, with only a
        pace few nodes are asked at once.
        """
        running = NmtState.OPERATIONAL in self._watch.states.values() or monotonic() - self._pdo_s < QUIET_S
        if running:
            return 1
        if self.bitrate is not None or self.simulated:
            return MOST_AT_ONCE
        return 1 if self.unknown_pace is None else FEW_AT_ONCE

    def _channel(self, node_id: int) -> SdoTransport:
        return self._sdo_channels.channel(node_id)

    def _repeated(self, node_id: int) -> int:
        return self._sdo_channels.repeated(node_id)

    def _dropped(self) -> dict[int, DroppedAnswers]:
        return self._sdo_channels.dropped()

    def _understand(self, message: M, can_id: int, data: bytes | bytearray, *, extended: bool) -> None:
        """Deliver data frame *message* to its receivers."""
        function, node_id = can_id & ~0x7F, can_id & 0x7F
        if function in _SDO_IDS:
            if function == SDO_RESPONSE_BASE:
                self._traffic.answered(message)
                self._watch.answered(node_id)
                self._answered(node_id)
            elif not extended:
                self._watch.request_of_another(self._frame_of(message))
            self._sdo_channels.receive(node_id, can_id, bytes(data), extended=extended)
        elif can_id > EMCY_BASE + 0x7F and function < SDO_RESPONSE_BASE:
            self._pdo_s = monotonic()
        elif not extended:
            self._told(message, can_id, data)

    def _told(self, message: M, can_id: int, data: bytes | bytearray) -> None:
        """Process a message of a node, or of another master."""
        function = can_id & ~0x7F
        if function == HEARTBEAT_BASE:
            self._heartbeat(self._frame_of(message))
            if data == b"\0":
                self._traffic.answered(message)
                self._sdo_channels.restarted(can_id & 0x7F)
        elif can_id == NMT_ID:
            self._received_command(bytes(data))
        elif can_id == LSS_RESPONSE_ID:
            self._traffic.answered(message)
        elif function == EMCY_BASE:
            self._traffic.answered(message)
            self._watch.emergency(self._frame_of(message))

    def _answered(self, node_id: int) -> None:
        """Called for an SDO answer of *node_id* to any client."""

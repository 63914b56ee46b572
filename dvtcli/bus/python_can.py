"""A CANopen network on any python-can bus.

Does not know how a bus is opened (see opening), nor what a PDO or an object means.
"""

from __future__ import annotations

import errno
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from queue import SimpleQueue
from time import monotonic, sleep
from weakref import WeakSet

import can

from dvtcli.bus import DEFAULT_RETRIES, DEFAULT_TIMEOUT_S
from dvtcli.bus.echoes import Echoes
from dvtcli.bus.error_frames import ErrorFrames
from dvtcli.bus.node_events import EMERGENCY, HEARTBEAT, Emergency, NodeEvent, NodeWatch
from dvtcli.bus.oddities import Oddities
from dvtcli.bus.receiver import Receiver, Wake, bus_closed
from dvtcli.bus.sdo.channel import SdoChannel
from dvtcli.bus.sdo.client import StrictSdoClient
from dvtcli.bus.sdo.link import ANSWER_ID, REQUEST_ID, Inbox, SdoSettings
from dvtcli.bus.traffic import Tap, Traffic, frame_of
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.errors import BusUnavailable, UsageError

#: what python-can's drivers raise when a bus fails in use; a closed socket is a ValueError in select()
BUS_FAILURES = (can.CanError, OSError, ValueError, RuntimeError)
#: how often a full transmit buffer is tried again, every 2 ms
SEND_PATIENCE = 50

_SDO_IDS = (ANSWER_ID, REQUEST_ID)
#: drivers that would send a data frame where a remote frame is asked for
_NO_REMOTE_FRAMES = frozenset({"socketcand"})


class CanBus:
    """A CANopenBus on a python-can *bus*, called *name* on screens; *on_close* is called after the bus was left.

    *hung_up* says whether the other end is gone where the driver only falls silent. No thread of its own: whoever
    waits reads the bus. *timeout_s* (s) and *retries* are those of `SdoSettings`.
    """

    def __init__(
        self,
        bus: can.BusABC,
        name: str,
        *,
        simulated: bool = False,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        retries: int = DEFAULT_RETRIES,
        bitrate: int | None = None,
        on_close: Callable[[], None] | None = None,
        hung_up: Callable[[], bool] = lambda: False,
    ) -> None:
        self._bus = bus
        self._hung_up = hung_up
        #: bit/s, None where nobody said
        self.bitrate = bitrate
        self._name = name
        self._simulated = simulated
        self.settings = SdoSettings(timeout_s, retries)
        self._on_close = on_close
        self._receiver: Receiver[can.Message] = Receiver(self._read, self._deliver)
        self._send_lock = threading.Lock()
        self._setup_lock = threading.Lock()
        self._clients: dict[int, StrictSdoClient] = {}
        self._channels: dict[int, SdoChannel] = {}
        self._watch = NodeWatch()
        self._life_waiters: WeakSet[SimpleQueue[bool | Wake]] = WeakSet()
        self._traffic = Traffic()
        self._oddities = Oddities()
        #: our own frames as they come back
        self.echoes = Echoes()
        #: what the CAN controller complained about
        self.error_frames = ErrorFrames()
        self._closed = False

    @property
    def name(self) -> str:
        """How the bus is called on screens, for example `socketcan:can0`."""
        return self._name

    @property
    def simulated(self) -> bool:
        """Whether nothing leaves this process."""
        return self._simulated

    @property
    def carries_remote_frames(self) -> bool:
        """Whether a remote frame can be sent: some ways to a bus would make a data frame of it."""
        return self._name.partition(":")[0] not in _NO_REMOTE_FRAMES

    def sdo(self, node_id: int) -> SdoChannel:
        """The default SDO channel of *node_id* (1..127); the same object for the same node."""
        if node_id not in self._channels:
            if not 1 <= node_id <= 127:
                raise UsageError(f"node-ID {node_id} is outside 1..127")
            with self._setup_lock:
                if node_id not in self._channels:
                    client = self._clients[node_id] = StrictSdoClient(node_id, self, self.settings)
                    self._channels[node_id] = SdoChannel(client)
        return self._channels[node_id]

    def send_nmt(self, command: NmtCommand, node_id: int) -> None:
        """Send an NMT command to *node_id*, or to all nodes with 0; what was heard of their states is forgotten."""
        if not 0 <= node_id <= 127:
            raise UsageError(f"node-ID {node_id} is outside 0..127")
        self._receiver.drain()
        self._watch.forget_state(node_id)
        self._oddities.commanded(command, node_id, self._watch.boot_ups)
        self.send(Frame(0x000, bytes([command, node_id])))

    def nmt_state(self, node_id: int, timeout_s: float = 0.0) -> NmtState | None:
        """The state last heard of *node_id* since its last NMT command; waits up to *timeout_s* for a *new* one.

        None: nothing was heard. A node that said boot-up is PRE-OPERATIONAL (CiA 301, 7.2.8.3.3).
        """
        self._receiver.drain()
        signs = self._watch.signs_of_life
        seen = signs.get(node_id, 0)
        if timeout_s > 0:
            self._wait_for(lambda: signs.get(node_id, 0) > seen, timeout_s)
        return self._watch.states.get(node_id)

    def boot_ups(self, node_id: int) -> int:
        """How many boot-up messages of *node_id* were seen so far."""
        self._receiver.drain()
        return self._watch.boot_ups.get(node_id, 0)

    def upsets(self, node_id: int) -> int:
        """A number that grows with each boot-up of *node_id*, and with each upload that had to be asked again."""
        client = self._clients.get(node_id)
        return self.boot_ups(node_id) + (0 if client is None else client.repeated)

    def downloads_of_others(self, node_id: int) -> int:
        """How many downloads of other SDO clients to *node_id* were seen since its last boot-up."""
        self._receiver.drain()
        return self._watch.downloads_of_others.get(node_id, 0)

    def wait_boot_up(self, node_id: int, seen: int, timeout_s: float) -> bool:
        """Wait until more than *seen* boot-ups of *node_id* were received; False after *timeout_s*."""
        return self._wait_for(lambda: self._watch.boot_ups.get(node_id, 0) > seen, timeout_s)

    def heard_nodes(self) -> dict[int, NmtState]:
        """Every node whose state is known, from heartbeats and boot-ups."""
        self._receiver.drain()
        return dict(self._watch.states)

    def emergency(self, node_id: int) -> Emergency | None:
        """The last emergency message of *node_id*."""
        self._receiver.drain()
        return self._watch.emergencies.get(node_id)

    def on_event(self, callback: Callable[[NodeEvent], None]) -> Callable[[], None]:
        """Call *callback* for each boot-up, state change and emergency; returns what ends that.

        It is called by the thread that happens to read the bus: it must be quick and must not use the bus.
        """
        self._watch.listeners.append(callback)
        return lambda: self._watch.listeners.remove(callback)

    def set_timeout(self, timeout_s: float) -> None:
        """Let every SDO answer take *timeout_s* from now on."""
        self.settings.timeout_s = timeout_s

    def disturbances(self) -> list[str]:
        """What was noticed since the last call: error frames, another SDO client, two nodes with one node-ID."""
        with suppress(BusUnavailable):  # a dead bus has told whoever used it
            self._receiver.drain()
        odd = self._oddities.news(self._channels, self._watch.boot_ups, self._watch.double_boot_ups)
        return [*self.error_frames.news(), *odd]

    def tap(self, callback: Tap) -> Callable[[], None]:
        """Call *callback*(frame, sent) for each frame received or sent here; returns what ends that. As `on_event`."""
        return self._traffic.tap(callback)

    def send(self, frame: Frame) -> None:
        """Send one frame (SYNC, a PDO); frames that answer it are kept for a `receive` within the next second."""
        self._receiver.drain()
        self._traffic.keep_answers()
        self._send(frame.can_id, frame.data, extended=frame.extended, remote=frame.remote)

    def receive(self, duration_s: float) -> Iterator[Frame]:
        """Yield every frame that arrives within *duration_s* of this call, and those since the last `send`."""
        self._receiver.drain()
        inbox = self._traffic.listen()
        return self._frames(inbox, monotonic() + duration_s)

    def idle(self, duration_s: float) -> None:
        """Read the bus for *duration_s* on behalf of the callbacks, as a background thread does in a loop.

        Gives way to any thread that waits for something. Raises BusUnavailable if the bus fails or was closed.
        """
        self._receiver.idle(duration_s)

    def now_s(self) -> float:
        """The time that deadlines are measured in (time.monotonic)."""
        return monotonic()

    def sleep(self, duration_s: float) -> None:
        """Wait *duration_s*, reading the bus meanwhile unless another thread does; raises BusUnavailable."""
        if duration_s > 0:
            self._receiver.idle(duration_s)

    def close(self) -> None:
        """Leave the bus, within some 20 ms; whoever waits for something gets BusUnavailable. May be called twice."""
        with self._setup_lock:
            if self._closed:
                return
            self._closed = True
        self._receiver.close()
        with suppress(*BUS_FAILURES):  # it is gone either way, and nobody uses it any more
            self._bus.shutdown()
        if self._on_close is not None:
            self._on_close()

    def send_sdo(self, can_id: int, data: bytes) -> None:
        """Send one SDO frame (SdoLink)."""
        self._send(can_id, data)

    def take(self, inbox: Inbox, deadline_s: float) -> bytes | None:
        """Wait for an SDO answer in *inbox* until *deadline_s* (SdoLink)."""
        return self._receiver.take(inbox, deadline_s)

    def drain(self) -> None:
        """Deliver what has already arrived (SdoLink)."""
        self._receiver.drain()

    def _send(self, can_id: int, data: bytes, *, extended: bool = False, remote: bool = False) -> None:
        message = can.Message(arbitration_id=can_id, data=data, is_extended_id=extended, is_remote_frame=remote)
        for patience in range(SEND_PATIENCE, -1, -1):
            if self._closed:
                raise bus_closed()
            try:
                self._send_once(message)
                break
            except BUS_FAILURES as error:
                if getattr(error, "error_code", None) != errno.ENOBUFS or not patience:
                    raise self._failed("send", error) from error
                sleep(0.002)
        self._traffic.sent(message)

    def _send_once(self, message: can.Message) -> None:
        with self._send_lock:
            self.echoes.expect(message, monotonic())
            try:
                self._bus.send(message)
            except BaseException:
                self.echoes.unsent()
                raise

    def _read(self, wait_s: float) -> can.Message | None:
        try:
            message = self._bus.recv(wait_s)
            if message is None:
                self.echoes.caught_up(monotonic())
                if self._hung_up():
                    raise ConnectionResetError("the server has closed the connection")
            return message
        except BUS_FAILURES as error:
            failure = self._failed("receive", error)
            self._receiver.fail(failure)
            raise failure from error

    def _failed(self, what: str, error: Exception) -> BusUnavailable:
        why = str(error).partition("\n")[0] or type(error).__name__  # python-can puts tracebacks into messages
        hint = "is the adapter still plugged in, and the interface up?"
        if isinstance(error, ConnectionError):
            hint = "is the server still running? start dvtcli again when it is"
        return BusUnavailable(f"{self._name} failed ({what})", why=why, hint=hint)

    def _deliver(self, message: can.Message) -> None:
        if message.is_error_frame:
            self.error_frames.notice(message)
        elif not self.echoes.is_echo(message):
            self._traffic.received(message)
            if not message.is_remote_frame:
                self._understand(message, message.arbitration_id & ~0x7F, message.arbitration_id & 0x7F)

    def _understand(self, message: can.Message, function: int, node_id: int) -> None:
        if function in _SDO_IDS:
            if function == ANSWER_ID:
                self.echoes.answered(REQUEST_ID + node_id)
            elif not message.is_extended_id:
                self._watch.request_of_another(frame_of(message))
            if node_id in self._clients:
                data, extended = bytes(message.data), message.is_extended_id
                self._clients[node_id].receive(message.arbitration_id, data, extended=extended)
        elif message.is_extended_id:
            return
        elif function == HEARTBEAT and self._watch.heartbeat(frame_of(message)):
            for waiter in tuple(self._life_waiters):
                waiter.put(True)
        elif function == EMERGENCY:
            self._watch.emergency(frame_of(message))

    def _frames(self, inbox: SimpleQueue[Frame | Wake], deadline_s: float) -> Iterator[Frame]:
        while (frame := self._receiver.take(inbox, deadline_s)) is not None:
            yield frame

    def _wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until *condition* holds, which signs of life may bring about."""
        deadline_s = monotonic() + timeout_s
        inbox: SimpleQueue[bool | Wake] = SimpleQueue()
        self._life_waiters.add(inbox)
        self._receiver.drain()
        while not condition():
            if self._receiver.take(inbox, deadline_s) is None:
                return condition()
        return True

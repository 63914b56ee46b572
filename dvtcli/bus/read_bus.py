"""A bus that is read by whichever thread waits for something, message by message, without a thread of its own.

Does not know what a message is (a CAN frame, a line of a gateway): a transport reads, understands and sends them.
"""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections.abc import Callable, Iterator
from queue import SimpleQueue
from time import monotonic
from typing import Generic, TypeVar
from weakref import WeakSet

from dvtcli.bus.receiver import Receiver, Wake
from dvtcli.bus.sdo.sdo_link import DEFAULT_RETRIES, DEFAULT_TIMEOUT_S, Inbox
from dvtcli.bus.traffic import Tap, Traffic
from dvtcli.bus.watched_bus import WatchedBus
from dvtcli.domain.ports import Frame
from dvtcli.errors import BusUnavailable

M = TypeVar("M")


class ReadBus(WatchedBus, Generic[M]):
    """A `WatchedBus` whose messages are read one at a time; *frame_of* makes a frame of one, for those who watch."""

    def __init__(
        self,
        name: str,
        frame_of: Callable[[M], Frame],
        *,
        simulated: bool = False,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        retries: int = DEFAULT_RETRIES,
        bitrate: int | None = None,
    ) -> None:
        super().__init__(name, simulated=simulated, timeout_s=timeout_s, retries=retries, bitrate=bitrate)
        self._receiver: Receiver[M] = Receiver(self._read_or_fail, self._deliver)
        self._traffic: Traffic[M] = Traffic(frame_of, self.now_s)
        self._life_waiters: WeakSet[SimpleQueue[bool | Wake]] = WeakSet()
        self._close_lock = threading.Lock()
        self._closed = False
        #: what ended the bus, whoever met it first: some drivers tell it once, and are silent then
        self._failure: BusUnavailable | None = None

    def tap(self, callback: Tap) -> Callable[[], None]:
        """Call *callback*(frame, sent) for each frame received or sent here; returns what ends that. As `on_event`."""
        return self._traffic.tap(callback)

    def exchanged(self) -> list[tuple[Frame, bool]]:
        """The frames that were sent here last, and those that answered them; each with whether it is ours."""
        return self._traffic.exchanged()

    def receive(self, duration_s: float) -> Iterator[Frame]:
        """Yield every frame that arrives within *duration_s* of this call, and those since the last `send`."""
        self._receiver.drain()
        inbox = self._traffic.listen()
        return self._frames(inbox, monotonic() + duration_s)

    def idle(self, duration_s: float) -> None:
        """Read the bus for *duration_s* on behalf of the callbacks, as a background thread does in a loop.

        Gives way to any thread that waits for something. Raises BusUnavailable if the bus fails, has failed whoever
        used it, or was closed.
        """
        if self._failure is not None:
            failure = self._failure
            raise BusUnavailable(failure.text, why=failure.why, hint=failure.hint)
        self._receiver.idle(duration_s)

    def now_s(self) -> float:
        """The time that deadlines are measured in (time.monotonic)."""
        return monotonic()

    def delay_s(self) -> float:
        """How long in all this machine, and no node, kept answers from being read (SdoLink), in seconds."""
        return self._receiver.delay_s(anew=len(self._transfers) < 2)

    def sleep(self, duration_s: float) -> None:
        """Wait *duration_s*, reading the bus meanwhile unless another thread does; raises BusUnavailable."""
        if duration_s > 0 and not self._gave_turn_until(monotonic() + duration_s):
            self._receiver.idle(duration_s)

    def take(self, inbox: Inbox, deadline_s: float) -> bytes | None:
        """Wait for what `_deliver` puts into *inbox* until *deadline_s* (as `now_s` tells); None where nothing came."""
        if self._gave_turn_for(inbox, deadline_s):
            item = None if inbox.empty() else inbox.get_nowait()
            return None if isinstance(item, Wake) else item
        return self._receiver.take(inbox, deadline_s)

    def drain(self) -> None:
        """Deliver what has already arrived."""
        self._receiver.drain()

    def close(self) -> None:
        """Leave the bus, within some 20 ms; whoever waits for something gets BusUnavailable. May be called twice."""
        with self._close_lock:
            if self._closed:
                return
            self._closed = True
        self._receiver.close()
        self._leave()

    @abstractmethod
    def _read(self, wait_s: float) -> M | None:
        """The next message, None where none came within *wait_s*; raises BusUnavailable where the bus failed."""

    @abstractmethod
    def _deliver(self, message: M) -> None:
        """Understand *message*: hand it to whom it answers, and to those who watch."""

    @abstractmethod
    def _leave(self) -> None:
        """Let go of what carries the bus; called once."""

    def _read_or_fail(self, wait_s: float) -> M | None:
        try:
            return self._read(wait_s)
        except BusUnavailable as failure:
            self._failure = failure
            self._receiver.fail(failure)  # whoever else waits
            raise

    def _heartbeat(self, frame: Frame) -> None:
        """Take a heartbeat or boot-up message, and wake who waits for one."""
        if self._watch.heartbeat(frame):
            for waiter in tuple(self._life_waiters):
                waiter.put(True)

    def _frames(self, inbox: SimpleQueue[Frame | Wake], deadline_s: float) -> Iterator[Frame]:
        """What comes until *deadline_s*, then what is there by then, read once: a bus may never be quiet."""
        while monotonic() < deadline_s:
            frame = self._receiver.take(inbox, deadline_s)
            if frame is None:
                return
            yield frame
        yield from _inside(inbox)
        self._until(lambda: False, deadline_s)
        yield from _inside(inbox)

    def _wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until *condition* holds, which signs of life may bring about."""
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
        """Read until *ready*, or *deadline_s*: whatever is there by then is read."""
        self._receiver.take(_Ready(ready), deadline_s)


def _inside(inbox: SimpleQueue[Frame | Wake]) -> Iterator[Frame]:
    """The frames in *inbox* now, without those that come meanwhile."""
    for _ in range(inbox.qsize()):
        frame = inbox.get_nowait()
        if not isinstance(frame, Wake):
            yield frame


class _Ready(SimpleQueue[bool | Wake]):
    """An inbox that has something in it as soon as *ready*, wherever that was delivered."""

    def __init__(self, ready: Callable[[], bool]) -> None:
        self._ready = ready

    def empty(self) -> bool:
        """Whether nobody is ready yet, and no note of the receiver is here."""
        return super().empty() and not self._ready()

    def get_nowait(self) -> bool | Wake:
        """The receiver's note, else that somebody is ready."""
        return True if super().empty() else super().get_nowait()

"""Bus reading by the waiting threads themselves, so that an answer needs no hand-over.

One waiting thread at a time leads: it reads and delivers messages until its own item is there; then it
promotes another waiting thread.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from math import inf
from queue import Empty, SimpleQueue
from time import monotonic, process_time, time
from typing import Any, Generic, TypeVar
from weakref import ref

from dvtcli.domain.ports import Frame
from dvtcli.errors import BusUnavailable

#: maximum time in one read (s): the delay until the reader of a silent bus notices a closed bus or a waiting client
SLICE_S = 0.02
#: time without waiting threads (s) before a background thread reads again
QUIET_S = 0.02
#: maximum messages read at once without waiting, as a busy bus never ends
BACKLOG = 4096
#: messages that a background thread reads at once behind one that it waited for
AT_ONCE = 64
#: how long past its deadline (s) an answer that is there already may take to be read: on a machine that is too busy to
#: read the bus, or a bus that is never quiet
GRACE_S = 1.0
#: shorter delays of the reading thread are normal (s)
LATE_S = 0.02
#: how exactly a delay is known (s): the processor time is a system call, as much as a twentieth of an exchange
EXACT_S = 0.005
M = TypeVar("M")
T = TypeVar("T")


class Wake:
    """A note to a waiting thread among its items: you may lead now, your time is over, or the bus has failed."""

    __slots__ = ("failure",)

    def __init__(self, failure: BusUnavailable | None = None) -> None:
        self.failure = failure


_LEAD, _TIME_IS_OVER = Wake(), Wake()


def bus_closed() -> BusUnavailable:
    """The error for use of a closed bus."""
    return BusUnavailable("the bus is closed")


class Receiver(Generic[M]):
    """Reads messages with *read* (seconds to wait -> message or None) and passes each to *deliver*.

    If the bus fails, *read* calls `fail` and raises BusUnavailable.
    """

    def __init__(self, read: Callable[[float], M | None], deliver: Callable[[M], None]) -> None:
        self._read = read
        self._deliver = deliver
        self._mutex = threading.Lock()
        self._leader: object | None = None
        #: whose thread reads; a thread that was interrupted while it ceased to lead finds itself here, and goes on
        self._leading_thread = 0
        #: waiting threads' inboxes, and their deadlines (s of time.monotonic)
        self._followers: dict[SimpleQueue[Any], float] = {}
        self._no_leader = threading.Condition(self._mutex)
        self._closing = threading.Event()
        self._closed = False
        self._last_wait_s = 0.0
        #: how long in all this machine kept the bus from being read (s), and until when that is known
        self._delay_s = 0.0
        self._delay_lock = threading.Lock()
        self._seen_s = monotonic()
        #: the processor time when it was last asked for, and the time since then without a delay (s)
        self._seen_cpu_s, self._passed_s = process_time(), 0.0

    def take(self, inbox: SimpleQueue[T | Wake], deadline_s: float) -> T | None:
        """The next item delivered into *inbox*; None at *deadline_s* (time.monotonic).

        Frames on the bus by then count, however late they are read. Only one thread at a time may wait for an inbox.
        Raises BusUnavailable if the bus fails or is closed.
        """
        try:
            while True:
                item = (self._lead if self._join(inbox, deadline_s) else self._follow)(inbox, deadline_s)
                if not isinstance(item, Wake):
                    return item
                if item is _TIME_IS_OVER and monotonic() >= deadline_s:  # otherwise the note is of an earlier wait
                    return None
                if item.failure is not None:
                    raise BusUnavailable(item.failure.text, why=item.failure.why, hint=item.failure.hint)
        finally:
            self._last_wait_s = monotonic()
            self._leave(inbox)

    def drain(self) -> None:
        """Deliver received frames without waiting; leaves this to the reading thread if one exists."""
        me = object()
        try:
            with self._mutex:
                leads = not self._closed and self._take_lead(me)
            if leads:
                self._read_waiting()
        finally:
            self._leave(me)

    def idle(self, duration_s: float) -> None:
        """Deliver frames received within *duration_s*, as a background thread does: waiting threads go first."""
        if self._closed:
            raise bus_closed()
        me = object()
        end_s = monotonic() + duration_s
        while not self._closed and (left_s := end_s - monotonic()) > 0:
            try:
                if not self._lead_when_quiet(me):
                    self._closing.wait(min(left_s, QUIET_S))
                    continue
                while not self._followers and not self._closed and (left_s := end_s - (now_s := monotonic())) > 0:
                    if self._read_one(min(left_s, SLICE_S), now_s):
                        self._read_waiting(AT_ONCE)
            finally:
                self._leave(me)

    def fail(self, failure: BusUnavailable) -> None:
        """Report a bus failure to all waiting threads; the reading thread raises it."""
        with self._mutex:
            for follower in self._followers:
                follower.put(Wake(failure))

    def close(self) -> None:
        """End all waits; on return no thread reads any more (a read that does not end is waited for 0.1 s)."""
        self._closed = True
        self._closing.set()
        self.fail(bus_closed())
        with self._no_leader:
            self._no_leader.wait_for(lambda: self._leader is None, timeout=0.1)

    def delay_s(self, *, anew: bool) -> float:
        """Total time in seconds during which this machine kept the bus from being read while a thread waited.

        The machine ran other work, or stood still. With *anew* no thread has waited until now.
        """
        self._note_delay(monotonic(), 0.0, not anew)
        return self._delay_s

    def _note_delay(self, now_s: float, waited_s: float = 0.0, counts: bool = True) -> None:
        """Count the time from the last call to *now_s*, less *waited_s* and the computing time of this process."""
        with self._delay_lock:
            passed_s = now_s - self._seen_s
            self._seen_s = now_s
            if passed_s < LATE_S + waited_s and self._passed_s + passed_s < EXACT_S:
                self._passed_s += passed_s
                return
            cpu_s = process_time()
            delay_s = passed_s - waited_s - max(cpu_s - self._seen_cpu_s - self._passed_s, 0.0)
            self._seen_cpu_s, self._passed_s = cpu_s, 0.0
            if counts and delay_s >= LATE_S:
                self._delay_s += delay_s

    def _join(self, inbox: SimpleQueue[T | Wake], deadline_s: float) -> bool:
        """Start to wait for *inbox* until *deadline_s*; whether as the leader."""
        with self._mutex:
            if self._closed:
                raise bus_closed()
            if self._take_lead(inbox):
                if self._followers:
                    self._followers.pop(inbox, None)
                return True
            self._followers[inbox] = deadline_s
            return False

    def _lead_when_quiet(self, me: object) -> bool:
        """Lead for no particular thread, if no thread leads or led a moment ago."""
        with self._mutex:
            quiet = monotonic() - self._last_wait_s >= QUIET_S
            return quiet and not self._closed and self._take_lead(me)

    def _take_lead(self, who: object) -> bool:
        """Make *who* the leader unless another thread leads; the caller holds the mutex."""
        thread = threading.get_ident()
        if self._leader is not None and self._leader is not who and self._leading_thread != thread:
            return False
        self._leader, self._leading_thread = who, thread
        return True

    def _lead(self, inbox: SimpleQueue[T | Wake], deadline_s: float) -> T | Wake | None:
        while inbox.empty():
            if self._closed:
                raise bus_closed()
            now_s = monotonic()
            left_s = deadline_s - now_s
            if left_s <= 0:
                self._read_waiting()  # the thread is late, not the answer
                return None if inbox.empty() else inbox.get_nowait()
            slice_s = left_s if left_s < SLICE_S else SLICE_S
            self._read_one(self._slice_s(slice_s) if self._followers else slice_s, now_s)
        return inbox.get_nowait()

    def _follow(self, inbox: SimpleQueue[T | Wake], deadline_s: float) -> T | Wake | None:
        """The next item or note; the reading thread reports the deadline, once nothing is waiting.

        This avoids the queue's own time-out, which CPython's SimpleQueue may lose after a spurious wake-up. A
        Queue's own locks may stay locked forever after a Ctrl-C.
        """
        try:
            return inbox.get(timeout=max(deadline_s - monotonic(), 0) + GRACE_S)
        except Empty:
            return None

    def _slice_s(self, most_s: float) -> float:
        """Time to read at once, *most_s* at most, so that no follower waits much longer than requested."""
        with self._mutex:
            first_s = min(self._followers.values(), default=inf)
        return max(min(most_s, first_s - monotonic()), 0.0)

    def _end_times(self, until_s: float) -> None:
        """End the waits of followers with deadlines up to *until_s*, since all frames until then were read."""
        with self._mutex:
            for follower in [one for one, deadline_s in self._followers.items() if deadline_s <= until_s]:
                self._followers[follower] = inf  # notify only once
                follower.put(_TIME_IS_OVER)

    def _leave(self, who: object) -> None:
        """Stop waiting; a leader promotes a follower without an item."""
        with self._mutex:
            if self._leader is not who:
                self._followers.pop(who, None)  # type: ignore[call-overload]
                return
            self._leader = None
            for heir in self._followers:
                if heir.empty():
                    del self._followers[heir]
                    self._leader, self._leading_thread = heir, 0  # until its thread wakes up
                    heir.put(_LEAD)
                    return
            if self._closed:
                self._no_leader.notify_all()

    def _read_one(self, wait_s: float, now_s: float) -> bool:
        if now_s - self._seen_s >= LATE_S:
            self._note_delay(now_s)
        message = self._read(wait_s)
        self._note_delay(monotonic(), wait_s)
        if message is not None:
            self._deliver(message)
        if self._followers:
            self._end_times(now_s if message is None else now_s - GRACE_S)  # for a bus that is never quiet
        return message is not None

    def _read_waiting(self, most: int = BACKLOG) -> None:
        read, deliver = self._read, self._deliver
        began_s = monotonic()
        for _ in range(most):
            message = read(0.0)
            if message is None:
                if self._followers:
                    self._end_times(began_s)
                break
            deliver(message)


#: frames received after a sent frame are kept for a `receive` within this time (s)
ANSWERS_KEPT_S = 1.0
#: number of remembered frames: sent frames and their answers
REMEMBERED = 1024
Tap = Callable[[Frame, bool], None]


class Traffic(Generic[M]):
    """Passes messages on as frames to all receivers; *now_s* returns the bus's time in seconds."""

    def __init__(self, frame_of: Callable[[M], Frame], now_s: Callable[[], float]) -> None:
        self._frame_of = frame_of
        self._now_s = now_s
        self._listeners: list[ref[SimpleQueue[Frame | Wake]]] = []
        self._taps: list[Tap] = []
        self._answers: deque[M] = deque(maxlen=4096)
        self._kept_until_s: float | None = None
        #: the last exchanges: message, whether it is ours, and time (s since 1970)
        self._exchanged: deque[tuple[M, bool, float]] = deque(maxlen=REMEMBERED)

    def tap(self, callback: Tap) -> Callable[[], None]:
        """Call *callback*(frame, sent) for each frame; returns a function that ends it."""
        self._taps.append(callback)
        return lambda: self._taps.remove(callback)

    def keep_answers(self) -> None:
        """Keep received frames for the next `listen` from now on: an answer may come before it."""
        self._answers.clear()
        self._kept_until_s = self._now_s() + ANSWERS_KEPT_S

    def listen(self) -> SimpleQueue[Frame | Wake]:
        """A queue that gets kept frames and all later frames, as long as it is referenced."""
        inbox: SimpleQueue[Frame | Wake] = SimpleQueue()
        if self._kept_until_s is not None and self._now_s() < self._kept_until_s:
            for message in tuple(self._answers):
                inbox.put(self._frame_of(message))
        self._kept_until_s = None
        self._listeners.append(ref(inbox, self._listeners.remove))
        return inbox

    def received(self, message: M) -> None:
        """Pass on a message from the bus."""
        if self._kept_until_s is not None:
            self._answers.append(message)
        if self._taps or self._listeners:
            frame = self._frame_of(message)
            for listener in tuple(self._listeners):
                inbox = listener()
                if inbox is not None:
                    inbox.put(frame)
            self._tell_taps(frame, False)

    def sent(self, message: M) -> None:
        """Distribute a sent message."""
        self._exchanged.append((message, True, time()))
        if self._taps:
            self._tell_taps(self._frame_of(message), True)

    def answered(self, message: M) -> None:
        """Record a message that belongs to a dvtcli exchange, or shows its result."""
        self._exchanged.append((message, False, time()))

    def exchanged(self) -> list[tuple[Frame, bool]]:
        """The last exchanges, oldest first: each frame, and whether it is ours."""
        return [(self._frame_of(one)._replace(timestamp_s=at_s), ours) for one, ours, at_s in tuple(self._exchanged)]

    def _tell_taps(self, frame: Frame, sent: bool) -> None:
        for tap in tuple(self._taps):
            tap(frame, sent)

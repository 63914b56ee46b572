"""Jobs in turns, one at a time: a waiting job gives the turn to another.

Only waits switch threads, so that shared data needs no locks. The owner of the bus reads it while all jobs wait.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import partial
from heapq import heappop, heappush
from math import inf
from typing import TypeVar

from dvtcli.bus.sdo.sdo_link import Inbox
from dvtcli.errors import BusUnavailable

T = TypeVar("T")
Ready = Callable[[], bool]
#: maximum delay until a Ctrl-C, an unreported end, or room for more jobs is noticed (s)
_LOOK_S = 0.1


#: the turns of each job's thread
_OF_THREAD: dict[int, Turns] = {}


def in_callers_thread(work: Callable[[], T]) -> T:
    """Run *work* in the thread that started the jobs; directly if no jobs are running."""
    turns = _OF_THREAD.get(threading.get_ident())
    if turns is None:
        return work()
    answers: list[T] = []
    turns.in_callers_thread(lambda: answers.append(work()))
    return answers[0]


class _Errand:
    """*work* that one thread runs for another; both wait with a time-out, so that Ctrl-C works."""

    def __init__(self, work: Callable[[], None]) -> None:
        self.fault: BaseException | None = None
        self._work = work
        self._ended = threading.Event()

    def run(self) -> None:
        """Run the work, once."""
        if self._ended.is_set():
            return
        try:
            self._work()
        except BaseException as fault:  # noqa: BLE001 - it is raised where the work was asked for
            self.fault = fault
        finally:
            self._ended.set()

    def wait(self) -> None:
        """Wait until the work is done; raises its error."""
        while not self._ended.wait(_LOOK_S):
            pass
        if self.fault is not None:
            raise self.fault


class _Worker:
    """Job *number*; *deadline_s* is its latest continuation, *thrown* the error to raise then."""

    def __init__(self, number: int, job: Callable[[], None], back: threading.Lock) -> None:
        self.number = number
        #: polled condition for continuation; None if the job is notified
        self.ready: Ready | None = None
        self.deadline_s = inf
        #: number of waits so far: notifications of earlier waits do not count
        self.waits = 0
        self.thrown: BaseException | None = None
        self.fault: BaseException | None = None
        self.ended = self.started = False
        self._job, self._back = job, back
        self._go = threading.Lock()
        self._go.acquire()

    def run(self) -> None:
        """Run the job in its own thread, and give up the turn for good."""
        try:
            self._job()
        except BaseException as fault:  # noqa: BLE001 - it is told where the work was asked for
            self.fault = fault
        finally:
            self.ended = True
            self._back.release()

    def take_turn(self, run: Callable[[_Worker], None]) -> None:
        """Let the job run until it waits or ends; called by the thread with the turn.

        *run* is its thread's function, started at the first turn.
        """
        self.ready, self.deadline_s = None, inf
        if self.started:
            self._go.release()
        else:
            self.started = True
            threading.Thread(target=run, args=(self,), daemon=True).start()
        self._back.acquire()

    def wait(self) -> None:
        """Give up the turn; called by the job's own thread."""
        self._back.release()
        self._go.acquire()
        if self.thrown is not None:
            thrown, self.thrown = self.thrown, None
            raise thrown


class Turns:
    """*jobs* in turns, at most *width*() at once, evaluated before each begins.

    *until*(ready, deadline_s) reads the bus until a job is ready, or until this time (of *now_s*). A job that waits for
    an answer is notified directly: a frame's cost does not depend on the number of waiting jobs.
    """

    def __init__(
        self,
        jobs: Sequence[Callable[[], None]],
        width: Callable[[], int],
        until: Callable[[Ready, float], None],
        now_s: Callable[[], float],
    ) -> None:
        self._back = threading.Lock()
        self._back.acquire()
        self._workers = [_Worker(number, job, self._back) for number, job in enumerate(jobs)]
        self._width, self._until, self._now_s = width, until, now_s
        self._by_thread: dict[int, _Worker] = {}
        #: jobs begun and not ended, in starting order
        self._going: dict[_Worker, None] = {}
        #: polled jobs among them
        self._asked: dict[_Worker, None] = {}
        #: notified jobs, each with its number of waits
        self._told: deque[tuple[_Worker, int]] = deque()
        #: (deadline, number, waits) of waiting jobs, including past waits
        self._deadlines: list[tuple[float, int, int]] = []
        self._torn = self._finished = False
        #: released when the starting thread has work to do
        self._woken = threading.Lock()
        self._woken.acquire()
        self._errand: _Errand | None = None
        #: errors in order of time
        self.faults: list[BaseException] = []

    def mine(self) -> bool:
        """Whether the current thread is a job's."""
        return threading.get_ident() in self._by_thread

    def wait(self, ready: Ready, deadline_s: float) -> None:
        """Let other jobs continue until *ready*, or *deadline_s*."""
        worker = self._waiting(deadline_s)
        worker.ready = ready
        self._asked[worker] = None
        worker.wait()

    def wait_until(self, deadline_s: float) -> None:
        """Let other jobs continue until *deadline_s*."""
        self._waiting(deadline_s).wait()

    def wait_for(self, inbox: Inbox, deadline_s: float) -> None:
        """Let other jobs continue until *inbox* has an item, or *deadline_s*."""
        worker = self._waiting(deadline_s)
        told = partial(self._told.append, (worker, worker.waits))
        inbox.on_arrival = told
        if not inbox.empty():
            told()
        try:
            worker.wait()
        finally:
            inbox.on_arrival = None

    def in_callers_thread(self, work: Callable[[], None]) -> None:
        """Let the starting thread do *work*; called by a job, which keeps the turn."""
        self._errand = errand = _Errand(work)
        self._wake()
        errand.wait()

    def _wake(self) -> None:
        with suppress(RuntimeError):  # already awake
            self._woken.release()

    def _waiting(self, deadline_s: float) -> _Worker:
        """The current thread's job, which waits until *deadline_s* at most."""
        worker = self._by_thread[threading.get_ident()]
        worker.waits += 1
        worker.deadline_s = deadline_s
        if deadline_s < inf:
            heappush(self._deadlines, (deadline_s, worker.number, worker.waits))
        return worker

    def run(self) -> None:
        """Run all jobs; after a fault no further job begins, and running jobs continue to their end.

        A KeyboardInterrupt in this thread is raised in each waiting job instead of here.
        """
        scheduler = threading.Thread(target=self._schedule, daemon=True)
        while not self._finished:
            try:
                if scheduler.ident is None:
                    scheduler.start()
                # not `join`: a thread whose join is interrupted counts as ended (Python 3.11); and never without a
                # time-out, since no Ctrl-C ends a wait for a lock on Windows
                while not self._finished:
                    self._woken.acquire(timeout=_LOOK_S)
                    if self._errand is not None:
                        self._errand.run()
            except KeyboardInterrupt:
                self._torn = True
                if scheduler.ident is None:
                    raise
        if self._torn and not self.faults:  # the interrupt came when no job waited any more
            self.faults.append(KeyboardInterrupt())

    def _schedule(self) -> None:
        try:
            self._run_all()
        except BaseException as fault:  # noqa: BLE001 - of a bug of ours: nobody goes on, and it is told
            self.faults.insert(0, fault)
        finally:
            self._finished = True
            self._wake()

    def _run_all(self) -> None:
        waiting = list(reversed(self._workers))
        while self._going or (waiting and not self.faults):
            while waiting and (not self._going or len(self._going) < self._width()) and not self.faults:
                self._take_turn(waiting.pop())
            for worker in self._ready(self._now_s() + _LOOK_S if waiting else inf):
                self._take_turn(worker)

    def _ready(self, until_s: float) -> Iterable[_Worker]:
        """Jobs to continue: those with a reached deadline after the bus was read; none at *until_s* (of `now_s`)."""
        if not self._going:
            return ()
        try:
            self._until(self._anybody_ready, min(self._first_s(), until_s))
        except BusUnavailable as failed:
            return self._throw(partial(BusUnavailable, failed.text, why=failed.why, hint=failed.hint))
        if self._torn:
            self._torn = False
            return self._throw(KeyboardInterrupt)
        return self._take_told() or self._overdue()

    def _throw(self, fault: Callable[[], BaseException]) -> Iterable[_Worker]:
        """All jobs continue, each with a *fault* of its own."""
        for worker in self._going:
            worker.thrown = fault()
        return tuple(self._going)

    def _anybody_ready(self) -> bool:
        return (
            self._torn or bool(self._told) or any(worker.ready is not None and worker.ready() for worker in self._asked)
        )

    def _take_told(self) -> Iterable[_Worker]:
        """Notified jobs, and other jobs that are ready, each once."""
        found: dict[_Worker, None] = {}
        while self._told:
            worker, waits = self._told.popleft()
            if worker.waits == waits and worker in self._going:
                found[worker] = None
        return (*found, *(waiting for waiting in self._asked if waiting.ready is not None and waiting.ready()))

    def _first_s(self) -> float:
        """The earliest deadline."""
        while self._deadlines and self._is_past(*self._deadlines[0]):
            heappop(self._deadlines)
        return self._deadlines[0][0] if self._deadlines else inf

    def _overdue(self) -> Iterable[_Worker]:
        """Jobs beyond their deadline, in their order."""
        now_s, found = self._now_s(), list[_Worker]()
        while self._first_s() <= now_s:
            found.append(self._workers[heappop(self._deadlines)[1]])
        return sorted(found, key=lambda worker: worker.number)

    def _is_past(self, deadline_s: float, number: int, waits: int) -> bool:
        worker = self._workers[number]
        return worker.waits != waits or worker.deadline_s != deadline_s

    def _take_turn(self, worker: _Worker) -> None:
        self._going[worker] = None
        self._asked.pop(worker, None)
        worker.take_turn(self._begin)
        if worker.ended:
            del self._going[worker]
            if worker.fault is not None:
                self.faults.append(worker.fault)

    def _begin(self, worker: _Worker) -> None:
        me = threading.get_ident()
        self._by_thread[me], _OF_THREAD[me] = worker, self
        try:
            worker.run()
        finally:
            del _OF_THREAD[me]  # another thread may get this number now


def one_by_one(jobs: Sequence[Callable[[], None]]) -> list[BaseException]:
    """Run *jobs* one after the other up to the first fault, and return it."""
    for job in jobs:
        try:
            job()
        except BaseException as fault:  # noqa: BLE001 - whoever asked for the work has to put it right
            return [fault]
    return []

"""Several pieces of work side by side, of which one runs at a time: who waits gives the turn to another one.

Threads that pass a baton: between two waits nothing else happens, so that what they share needs no locks. Knows neither
buses nor signals: whoever owns the wire reads it while all of them wait.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from math import inf

from dvtcli.errors import BusUnavailable

Ready = Callable[[], bool]
#: how long it may take until a Ctrl-C is seen, or an end that was not told (s)
_LOOK_S = 0.1


class _Worker:
    """One piece of work; *ready* and *deadline_s* say when it goes on, *thrown* with what."""

    def __init__(self, job: Callable[[], None], back: threading.Lock) -> None:
        self.ready: Ready = lambda: True
        self.deadline_s = inf
        self.thrown: BaseException | None = None
        self.fault: BaseException | None = None
        self.ended = self.started = False
        self._job, self._back = job, back
        self._go = threading.Lock()
        self._go.acquire()

    def run(self) -> None:
        """Do the work, in a thread of its own, and give the turn away for good."""
        try:
            self._job()
        except BaseException as fault:  # noqa: BLE001 - it is told where the work was asked for
            self.fault = fault
        finally:
            self.ended = True
            self._back.release()

    def take_turn(self, begin: Callable[[], None]) -> None:
        """Let it run until it waits again, or ends; called by the thread that has the turn.

        *begin* starts its thread, the first time.
        """
        if self.started:
            self._go.release()
        else:
            self.started = True
            begin()
        self._back.acquire()

    def wait(self, ready: Ready, deadline_s: float) -> None:
        """Give the turn away until *ready*, or *deadline_s*; called by its own thread."""
        self.ready, self.deadline_s = ready, deadline_s
        self._back.release()
        self._go.acquire()
        if self.thrown is not None:
            thrown, self.thrown = self.thrown, None
            raise thrown


class Turns:
    """*jobs* that take turns, *width* of them at most at once.

    *until*(ready, deadline_s) reads the bus until one of them is ready, or that time of *now_s*.
    """

    def __init__(
        self,
        jobs: Sequence[Callable[[], None]],
        width: int,
        until: Callable[[Ready, float], None],
        now_s: Callable[[], float],
    ) -> None:
        self._back = threading.Lock()
        self._back.acquire()
        self._workers = [_Worker(job, self._back) for job in jobs]
        self._width, self._until, self._now_s = width, until, now_s
        self._by_thread: dict[int, _Worker] = {}
        self._torn = self._finished = False
        self._ended = threading.Lock()
        self._ended.acquire()
        #: what went wrong, in the order of time
        self.faults: list[BaseException] = []

    def mine(self) -> bool:
        """Whether the present thread is one of them."""
        return threading.get_ident() in self._by_thread

    def wait(self, ready: Ready, deadline_s: float) -> None:
        """Let others go on until *ready*, or *deadline_s*."""
        self._by_thread[threading.get_ident()].wait(ready, deadline_s)

    def run(self) -> None:
        """Run them all; after a fault of one no other is begun, and those that were go on to their end.

        A KeyboardInterrupt in this thread tears each of them apart where it waits, and is none of this thread's then.
        """
        scheduler = threading.Thread(target=self._schedule, daemon=True)
        try:
            scheduler.start()
        except KeyboardInterrupt:
            self._torn = True
        # not `join`: a thread whose join is interrupted counts as ended (Python 3.11); and never without a time-out,
        # since no Ctrl-C ends a wait for a lock on Windows
        while scheduler.ident is not None and not self._finished:
            try:
                while not self._finished:
                    self._ended.acquire(timeout=_LOOK_S)
            except KeyboardInterrupt:
                self._torn = True
        if not self._finished:
            raise KeyboardInterrupt

    def _schedule(self) -> None:
        try:
            self._run_all()
        except BaseException as fault:  # noqa: BLE001 - of a bug of ours: nobody goes on, and it is told
            self.faults.insert(0, fault)
        finally:
            self._finished = True
            self._ended.release()

    def _run_all(self) -> None:
        going: list[_Worker] = []
        waiting = list(reversed(self._workers))
        while going or (waiting and not self.faults):
            while waiting and len(going) < self._width and not self.faults:
                going.append(waiting.pop())
                self._take_turn(going[-1])
            going = [one for one in going if not one.ended]
            for one in self._ready(going):
                self._take_turn(one)
            going = [one for one in going if not one.ended]

    def _ready(self, going: Sequence[_Worker]) -> Sequence[_Worker]:
        """Who goes on: those whose time has come once the bus was read."""
        if not going:
            return ()
        try:
            deadline_s = min(one.deadline_s for one in going)
            self._until(lambda: self._torn or any(one.ready() for one in going), deadline_s)
        except BusUnavailable as failed:
            for one in going:
                one.thrown = BusUnavailable(failed.text, why=failed.why, hint=failed.hint)
            return going
        if self._torn:
            self._torn = False
            for one in going:
                one.thrown = KeyboardInterrupt()
            return going
        ready = [one for one in going if one.ready()]
        return ready or [one for one in going if one.deadline_s <= self._now_s()]

    def _take_turn(self, worker: _Worker) -> None:
        worker.take_turn(threading.Thread(target=self._begin, args=(worker,), daemon=True).start)
        if worker.ended and worker.fault is not None:
            self.faults.append(worker.fault)

    def _begin(self, worker: _Worker) -> None:
        self._by_thread[threading.get_ident()] = worker
        worker.run()


def one_by_one(jobs: Sequence[Callable[[], None]]) -> list[BaseException]:
    """Run *jobs* one after the other up to the first fault, which is answered."""
    for job in jobs:
        try:
            job()
        except BaseException as fault:  # noqa: BLE001 - whoever asked for the work has to put it right
            return [fault]
    return []

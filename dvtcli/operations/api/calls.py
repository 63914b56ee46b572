"""Run each call of the Python API like a command line: own options, NMT states restored at its end.

A bus runs a single call at a time, from any thread.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar
from weakref import WeakSet

from dvtcli.device.restarts import losses, refuse_after_restarts
from dvtcli.errors import Bug, BusUnavailable, DvtcliError, Interrupted, UsageError
from dvtcli.operations.api.called_hints import answer_in_calls, errors_in_calls
from dvtcli.operations.api.checks import flags

if TYPE_CHECKING:
    from types import FrameType

    from dvtcli.device.cancellation import Cancellation
    from dvtcli.operations.session.session import Session


@contextmanager
def ctrl_c_at_safe_points(cancellation: Cancellation) -> Iterator[None]:
    """Delay Ctrl-C in a block to the next safe point; a second Ctrl-C acts at once.

    Only in the main thread and with Python's own handler: a program's handler stays.
    """
    if threading.current_thread() is not threading.main_thread() or (
        signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    ):
        yield
        return

    def stop(number: int, _frame: FrameType | None) -> None:
        if cancellation.asked(128 + number, insists=True):
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


T = TypeVar("T")
#: this program's buses in use
_OPEN: WeakSet[Calls] = WeakSet()
_OPEN_LOCK = threading.Lock()


class Calls:
    """The calls of a bus with their common *session*."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self._turn = threading.Lock()
        self._owner: int | None = None
        #: the thread in a dry run
        self.rehearsing: int | None = None
        self.closed = False
        with _OPEN_LOCK:
            _OPEN.add(self)

    def run(self, work: Callable[[], T], *, changes: bool = False, yes: bool = False, force: bool = False) -> T:
        """Run *work* with *yes* and *force* as options of a line; returns its result.

        If it *changes* something, raises Restarted if a node has lost its changes by the end. Raises KeyboardInterrupt
        after Ctrl-C, once the device's state is known: its text names the state.
        """
        flags(yes=yes, force=force)
        session = self.session
        with self.alone():
            if self.rehearsing not in (None, threading.get_ident()):
                raise UsageError("another thread's dry run is going on: call again when it has ended")
            session.cancellation.reset()
            session.acts()  # what was sent before is not this call's
            with ctrl_c_at_safe_points(session.cancellation):
                try:
                    with session.under(yes=yes, force=force):
                        result = work()
                        if changes and not session.dry_run:
                            refuse_after_restarts(list(session.met_nodes()))
                except BaseException as raised:
                    self._failed(raised)
                    raise
                try:
                    session.end_line(0, alone=changes and not session.dry_run)
                finally:
                    self._tell_what_was_noticed()
            if session.cancellation.requested:
                raise KeyboardInterrupt("Ctrl-C came too late to stop it: it is complete, and its changes stay")
        return answer_in_calls(result)

    def _failed(self, raised: BaseException) -> None:
        """Restore NMT states after *raised*; adds failures to it."""
        try:
            self.session.end_line(_code_of(raised))
            self._tell_what_was_noticed()
        except DvtcliError as second:
            raised.add_note(f"then: {second}")
        if isinstance(raised, Interrupted):
            raise KeyboardInterrupt(f"{raised.text}; the device: {raised.state}") from raised

    def _tell_what_was_noticed(self) -> None:
        """Report other SDO clients on the bus, and nodes that restarted and lost changes."""
        session = self.session
        for text in (*session.wire.disturbances(), *losses(list(session.met_nodes()))):
            session.reporter.warning(text)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep other threads off the bus during a block.

        Raises UsageError if a call-back calls the bus, BusUnavailable after it is closed.
        """
        if self._owner == threading.get_ident():
            raise UsageError("a call-back must not call the bus that calls it: remember what it says, and call later")
        with self._turn:
            self.refuse_closed()
            self._owner = threading.get_ident()
            try:
                with errors_in_calls(others=self._are_others_open()):
                    yield
            finally:
                self._owner = None

    def refuse_closed(self) -> None:
        """BusUnavailable once the bus is closed."""
        if self.closed:
            raise BusUnavailable("the bus is closed")

    def _are_others_open(self) -> bool:
        with _OPEN_LOCK:  # other threads open buses meanwhile
            return any(not other.closed for other in _OPEN if other is not self)

    def close(self) -> None:
        """Leave the bus once no call is at work on it; further calls raise BusUnavailable."""
        if self._owner == threading.get_ident():
            raise UsageError("a call-back must not close the bus that calls it")
        with self._turn:
            if not self.closed:
                self.closed = True
                self.session.close()


def _code_of(raised: BaseException) -> int:
    """Return the exit code of a command with this error."""
    if isinstance(raised, DvtcliError):
        return raised.exit_code
    return (Interrupted if isinstance(raised, KeyboardInterrupt) else Bug).exit_code

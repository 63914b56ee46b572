"""Run each call of the Python API like a command line: own options, NMT states restored at its end.

A bus runs a single call at a time, from any thread.
"""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeVar
from weakref import WeakSet

from dvtcli.bus.turns import in_callers_thread
from dvtcli.device.node import losses, refuse_after_restarts
from dvtcli.errors import Bug, BusUnavailable, DvtcliError, Interrupted, UsageError
from dvtcli.operations.api.called_hints import answer_in_calls, errors_in_calls, in_calls
from dvtcli.operations.api.checks import flags

if TYPE_CHECKING:
    from types import FrameType

    from dvtcli.device.cancellation import Cancellation
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results.frames import BusEvent
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
                raise UsageError("another thread's dry run is running: call again when it has ended")
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
                raise KeyboardInterrupt("Ctrl-C was too late: the command is complete and its changes remain")
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
            raise UsageError("a callback must not call the bus that calls it: save the data and make the call later")
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


LOG = logging.getLogger("dvtcli")
LOG.addHandler(logging.NullHandler())


@dataclass(frozen=True, slots=True)
class Message:
    """A message of a command beside its result: a `note`, or a `warning`."""

    kind: Literal["note", "warning"]
    text: str


class Told:
    """The reporter of a program: *on_message* and the log get messages; *ask_user* gets questions."""

    unanswered = "not confirmed"

    def __init__(
        self, on_message: Callable[[Message], None] | None = None, ask_user: Callable[[str], bool] | None = None
    ) -> None:
        self._on_message = on_message
        self._ask_user = ask_user

    def note(self, text: Hint | str) -> None:
        """Something good to know."""
        self._say("note", text, logging.INFO)

    def warning(self, text: Hint | str) -> None:
        """Report a warning."""
        self._say("warning", text, logging.WARNING)

    def bus(self, event: BusEvent) -> None:
        """Report a lost or returned bus."""
        self.warning(event.text)

    def instruct(self, text: str) -> None:
        """Report what to do by hand now, such as switching a node off and on."""
        self._say("warning", text, logging.WARNING)

    def _say(self, kind: Literal["note", "warning"], text: Hint | str, level: int) -> None:
        message = Message(kind, in_calls(text))
        in_callers_thread(lambda: self._hand_on(message, level))

    def _hand_on(self, message: Message, level: int) -> None:
        LOG.log(level, "%s", message.text)
        if self._on_message is not None:
            self._on_message(message)

    def ask(self, question: str) -> bool | None:
        """Ask; None if nobody can answer."""
        ask = self._ask_user
        return None if ask is None else in_callers_thread(lambda: bool(ask(question)))

    def confirm(self, question: str, word: str) -> bool | None:  # noqa: ARG002
        """Ask; the function of a program is told the question, and types nothing."""
        return self.ask(question)

    def progress(self, text: str, done: int, total: int) -> None:
        """Ignore it: a program has *on_progress*."""

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None) -> None:
        """Nothing: no call asks for traffic."""

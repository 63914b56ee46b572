"""A full screen by prompt_toolkit, redrawn until a key ends it."""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from time import monotonic
from typing import TYPE_CHECKING, Protocol

from dvtcli.cli.screen.widgets import Question
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.errors import BusUnavailable, DvtcliError

if TYPE_CHECKING:
    from prompt_toolkit import Application
    from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent

    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.screen.canvas import Mouse
    from dvtcli.cli.view.lines import Cell
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.frames.watch_bus import Watched
    from dvtcli.operations.results.frames import BusEvent
    from dvtcli.operations.session.steady_listener import SteadyListener
    from dvtcli.watch.decoder import Decoder

#: maximum wait for a pending answer on leaving (s)
LEAVE_S = 2.0


class MappingReader:
    """Reads the mappings for *watched* once, in a thread; `news` returns the progress.

    *turn* is held while a node is read.
    """

    def __init__(self, watched: Watched, turn: AbstractContextManager[object] | None = None) -> None:
        self._watched = watched
        self._turn = turn or nullcontext()
        #: the node being read, None if none
        self.node: int | None = None
        #: the error that ended the thread, None if none; the listener reports a lost bus
        self.failure: BaseException | None = None
        #: whether more data will follow
        self.is_reading = True
        self._news: Decoder | None = None
        self._stopping = False
        self._thread = threading.Thread(target=self._read, name="reading mappings", daemon=True)
        self._thread.start()

    def _read(self) -> None:
        try:
            decoders = self._watched.decoders()
            while not self._stopping:
                with self._turn:
                    found = next(decoders, None)
                if found is None:
                    break
                self.node, self._news = found
        except BusUnavailable:
            pass
        except BaseException as failed:  # noqa: BLE001 - nobody sees what ends a thread: `news` raises it
            self.failure = failed
        finally:  # in this order: who sees that no node is being read may ask for the next reading at once
            self.is_reading, self.node = False, None

    def news(self) -> Decoder | None:
        """Return the decoder so far, None if unchanged since the last call. Raises the reader's error."""
        news, self._news = self._news, None
        if self.failure is not None:
            raise self.failure
        return news

    def stop(self) -> None:
        """Read no other node."""
        self._stopping = True
        self._thread.join(LEAVE_S)


#: maximum wait for an opening bus on leaving (s)
_LEAVE_S = 0.2


class GoneBus:
    """Waits in a thread for the lost bus of *listener*."""

    def __init__(self, listener: SteadyListener) -> None:
        self._listener = listener
        self._thread: threading.Thread | None = None
        self._since_s = 0.0
        self._failure: DvtcliError | None = None
        self._leaving = threading.Event()

    @property
    def gone_s(self) -> float | None:
        """Seconds since the bus was lost, None if present."""
        return None if self._thread is None else monotonic() - self._since_s

    def wait(self, failed: BusUnavailable) -> None:
        """Wait for the bus from now on, after it *failed*."""

        def wait() -> None:
            try:
                self._listener.come_back(failed, self._leaving.is_set)
            except DvtcliError as ended:
                self._failure = ended

        self._since_s = monotonic()
        self._thread = threading.Thread(target=wait, name="waiting for the bus", daemon=True)
        self._thread.start()

    def is_waiting(self) -> bool:
        """Whether the bus is still lost."""
        return self._thread is not None and self._thread.is_alive()

    def back_after_s(self) -> float | None:
        """Return the duration of the loss once the bus is back, else None. Raises DvtcliError if not waited for."""
        if self._thread is None or self._thread.is_alive():
            return None
        gone_s, self._thread = monotonic() - self._since_s, None
        if self._failure is not None:
            raise self._failure
        return gone_s

    def leave(self) -> None:
        """Stop waiting."""
        self._leaving.set()
        if self._thread is not None:
            self._thread.join(_LEAVE_S)


#: interval of redrawing (s)
REDRAW_S = 0.1
STYLE = {
    "bold": "bold", "dim": "ansibrightblack", "red": "ansired bold", "yellow": "ansiyellow", "green": "ansigreen",
    "cyan": "ansicyan", "reverse": "reverse",
}  # fmt: skip
_PLAIN = ("", "dumb", "unknown")


class Screen(Protocol):
    """The contents of a full screen."""

    def gather(self) -> None:
        """Take new data; an error ends the screen."""
        ...

    def lines(self, columns: int, rows: int) -> Iterable[list[Cell]]:
        """Return the picture for *columns* x *rows*."""
        ...

    def leave(self) -> None:
        """The screen has ended."""
        ...


def has_full_screen(session: Conversation) -> bool:
    """Whether *session* runs at a terminal capable of a full screen."""
    name = os.environ.get("TERM", "windows" if sys.platform == "win32" else "")  # a Windows console gives itself none
    terminal = sys.stdin.isatty() and sys.stdout.isatty() and name.lower() not in _PLAIN
    return terminal and not session.output.json and not session.in_script


def show(
    session: Conversation,
    screen: Screen,
    keys: KeyBindings,
    duration_s: float | None,
    mouse: Mouse | None = None,
) -> None:
    """Show *screen* until a key, Ctrl-C or *duration_s*. Raises errors of its `gather`.

    *mouse* gets what the mouse does; without it the terminal keeps the mouse to itself.
    """
    try:
        with _held_signals() as came, session.output.held(), _short_collections():
            application, begin = _application(session, screen, keys, duration_s, came, mouse)
            application.run(pre_run=begin)
    finally:
        screen.leave()


#: new objects that begin a collection of cycles while a screen is shown
_NEW_OBJECTS = 5_000


@contextmanager
def _short_collections() -> Iterator[None]:
    """Collect cycles often, in a millisecond, and look at no object from before the screen.

    Each picture leaves some 70 objects in cycles. A collection of all objects of a large EDS takes longer than the
    picture of a key.
    """
    before, is_first = gc.get_threshold(), not gc.get_freeze_count()
    gc.freeze()
    gc.set_threshold(_NEW_OBJECTS)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        if is_first:
            gc.unfreeze()


@contextmanager
def _held_signals() -> Iterator[list[int]]:
    """Keep signals away from prompt_toolkit, because an exception while drawing would leave the screen broken.

    The list collects them. SIGINT only leaves the screen; other signals stop dvtcli at the end.
    """
    numbers = [getattr(signal, name, None) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")]
    handled = [number for number in numbers if number is not None and callable(signal.getsignal(number))]
    came: list[int] = []
    before = {number: signal.signal(number, lambda at, _frame: came.append(at)) for number in handled}
    try:
        yield came
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for number in came:
            if number != signal.SIGINT:
                signal.raise_signal(number)


def _application(
    session: Conversation,
    screen: Screen,
    keys: KeyBindings,
    duration_s: float | None,
    came: list[int],
    mouse: Mouse | None,
) -> tuple[Application[None], Callable[[], None]]:
    """Build the application for *screen*, ended by a key or a signal that *came*, and what begins to look at it."""
    from prompt_toolkit import Application
    from prompt_toolkit.layout import Layout
    from prompt_toolkit.output import ColorDepth
    from prompt_toolkit.styles import Style

    from dvtcli.cli.screen.canvas import Canvas

    until_s = None if duration_s is None else monotonic() + duration_s
    canvas = Canvas(screen.lines, mouse, plain=session.output.plain)

    def renew() -> bool:
        """Take what is new; whether the picture is another one. Not after the end, when the loop may still run."""
        if application.is_done or not application.is_running:
            return False
        try:
            screen.gather()
            size = application.output.get_size()
            changed = canvas.renew(size.columns, size.rows)
        except BaseException as failed:  # noqa: BLE001 - raised here it would stay inside of prompt_toolkit's event loop
            application.exit(exception=failed)
            return False
        if came or (until_s is not None and monotonic() >= until_s):
            application.exit()
        return changed

    def drawn(_application: Application[None]) -> None:
        """A picture is due: of a key, at the start, or after a resize."""
        renew()

    def look() -> None:
        """Draw the picture again when it changed by itself."""
        if renew():
            application.invalidate()
        begin()

    def begin() -> None:
        if application.loop is not None and application.is_running:
            application.loop.call_later(REDRAW_S, look)

    application: Application[None] = Application(
        layout=Layout(canvas),
        key_bindings=keys,
        mouse_support=mouse is not None,
        style=Style.from_dict(STYLE),
        full_screen=True,
        before_render=drawn,
        color_depth=ColorDepth.DEPTH_1_BIT if session.output.color == "never" else None,
    )
    application.ttimeoutlen = 0.05
    return application, begin


def bind(keys: KeyBindings, act: Callable[[], object], *names: str, unless: Callable[[], bool] | None = None) -> None:
    """Let the keys *names* do *act*, but not while *unless*()."""
    from prompt_toolkit.filters import Condition

    for name in names:
        keys.add(name, filter=Condition(lambda: unless is None or not unless()))(lambda _event: act())


def bind_leaving(keys: KeyBindings, unless: Callable[[], bool] | None = None) -> None:
    """Let Ctrl-C and q leave the screen, q not while *unless*()."""
    from prompt_toolkit.filters import Condition

    @keys.add("q", filter=Condition(lambda: unless is None or not unless()))
    @keys.add("c-c")
    @keys.add("<sigint>")
    def _leave(event: KeyPressEvent) -> None:
        """Leave the screen only."""
        if event.app.is_running and not event.app.is_done:
            event.app.exit()


#: names of keys that prompt_toolkit calls by their control codes
_KEY_NAMES = {"c-m": "enter", "c-h": "backspace", "c-i": "tab", "<bracketed-paste>": "paste"}


def bind_all(keys: KeyBindings, press: Callable[[str, str], None], when: Callable[[], bool]) -> None:
    """Give all keys to *press*, by name and text, while *when*(); Ctrl-C too."""
    from prompt_toolkit.filters import Condition

    @keys.add("<any>", filter=Condition(when))
    @keys.add("<bracketed-paste>", filter=Condition(when))
    @keys.add("c-c", filter=Condition(when))
    @keys.add("escape", filter=Condition(when))
    def _press(event: KeyPressEvent) -> None:
        """Hand it on."""
        key = event.key_sequence[0].key
        name = str(getattr(key, "value", key))
        is_text = len(name) == 1 or name == "<bracketed-paste>"
        press(_KEY_NAMES.get(name, name), event.data if is_text else "")


#: interval at which a wait for an operation's end sees a Ctrl-C (s)
_LOOK_S = 0.1


class BesideScreen:
    """Runs operations of *session* in a thread, and is its reporter until `leave`.

    *turn* is held while an operation runs: others that use the nodes take it too.
    """

    def __init__(self, session: Conversation) -> None:
        self.turn = threading.Lock()
        #: the open question, None if there is none
        self.question: Question | None = None
        #: what is being done, empty for nothing
        self.doing = ""
        self._session, self._outer = session, session.reporter
        self._said: deque[tuple[str, bool]] = deque()
        self._failure: BaseException | None = None
        self._thread: threading.Thread | None = None
        self._answer: bool | None = None
        self._answered = threading.Event()
        self._leaving = self._is_check = False
        session.reporter = self

    def start(self, doing: str, work: Callable[[], str], *, is_check: bool = False) -> None:
        """Do *work* now, called *doing*; its text is said at its end. Says so if another operation is running.

        *is_check*: it asks nothing, and another operation begins after it.
        """
        if self.doing and not self._is_check:
            self.say(f"{doing}: not yet, {self.doing} is running", bad=True)
            return
        self.doing, self._is_check = doing, is_check
        self._thread = threading.Thread(target=self._run, args=(work,), name=doing, daemon=True)
        self._thread.start()

    def _run(self, work: Callable[[], str]) -> None:
        try:
            with self.turn:
                if text := work():
                    self.say(text)
        except DvtcliError as failed:
            self.say(in_a_line(self._session, failed), bad=True)
        except BaseException as failed:  # noqa: BLE001 - nobody sees what ends a thread: `news` raises it
            self._failure = failed
        finally:
            if self._mine():
                self.doing, self._is_check = "", False

    def say(self, text: str, *, bad: bool = False) -> None:
        """Show *text* among the screen's messages, or after the screen once it is left."""
        if self._leaving and not self._mine():
            (self._outer.warning if bad else self._outer.note)(text)
        else:
            self._said.append((text, bad))

    def news(self) -> list[tuple[str, bool]]:
        """Return the messages since the last call, each with whether it is bad. Raises an operation's bug."""
        if self._failure is not None:
            raise self._failure
        return [self._said.popleft() for _ in range(len(self._said))]

    def leave(self) -> None:
        """Answer an open question with no, wait for the operation, and give the session its reporter back."""
        self._leaving = True
        self._answered.set()
        while self._thread is not None and self._thread.is_alive():
            self._thread.join(_LOOK_S)
        self._session.reporter = self._outer
        for text, bad in self._said:
            (self._outer.warning if bad else self._outer.note)(text)

    def _mine(self) -> bool:
        return threading.current_thread() is self._thread

    def note(self, text: Hint | str) -> None:
        """Show a message of an operation; others are told after the screen."""
        if self._mine():
            self.say(self._session.output.hints().text(text))
        else:
            self._outer.note(text)

    def warning(self, text: Hint | str) -> None:
        """Show a warning of an operation; others are told after the screen."""
        if self._mine():
            self.say(self._session.output.hints().text(text), bad=True)
        else:
            self._outer.warning(text)

    def bus(self, event: BusEvent) -> None:
        """Report a lost or restored bus after the screen."""
        self._outer.bus(event)

    def instruct(self, text: str) -> None:
        """Show what the user must do."""
        self.say(text, bad=True)

    @property
    def unanswered(self) -> str:
        """Why a question has no answer."""
        return self._outer.unanswered

    def ask(self, question: str) -> bool | None:
        """Ask on the screen; no if the screen is left."""
        if not self._mine():
            return self._outer.ask(question)
        self._answer = None
        self._answered.clear()
        if self._leaving:
            return False
        self.question = Question(question, self._take_answer)
        try:
            self._answered.wait()
        finally:
            self.question = None
        return bool(self._answer)

    def confirm(self, question: str, word: str) -> bool | None:
        """Nobody types a word on a screen of keys; others are asked as usual."""
        return None if self._mine() else self._outer.confirm(question, word)

    def _take_answer(self, answer: bool) -> None:
        self._answer = answer
        self._answered.set()

    def progress(self, text: str, done: int, total: int) -> None:
        """Show no progress: the screen itself moves."""

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None) -> None:
        """Report a frame after the screen, if wanted."""
        self._outer.traffic(frame, sent=sent, secret=secret)


def in_a_line(session: Conversation, failed: DvtcliError) -> str:
    """Return *failed* with its reason and hint on one line."""
    if failed.abort is not None:
        from dvtcli.operations.user.usual_cause import add_usual_cause

        add_usual_cause(failed)
    words = [error_text(failed), failed.why or "", session.output.hints().text(failed.hint) if failed.hint else ""]
    return "; ".join(word for word in words if word)

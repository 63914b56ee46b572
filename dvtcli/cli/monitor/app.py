"""The monitor's full screen: keys, redrawing, leaving. Knows prompt_toolkit; what is drawn is `screen`'s.

Where the bus is gone a thread waits for it, so that the screen stays alive.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from time import monotonic, time
from typing import TYPE_CHECKING

from dvtcli.cli.monitor.screen import GRAPH, RAW, TABLE, Moment, View, chosen_signals, picture
from dvtcli.cli.view.glyphs import ascii_only
from dvtcli.errors import BusUnavailable, DvtcliError
from dvtcli.watch.seen import FrameStore

if TYPE_CHECKING:
    from prompt_toolkit import Application
    from prompt_toolkit.formatted_text import StyleAndTextTuples
    from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent

    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.watch_bus import Watched

#: the screen is drawn anew this often (s)
REDRAW_S = 0.1
#: how long leaving may take where the bus is being opened (s)
_LEAVE_S = 0.2
STYLE = {
    "bold": "bold", "dim": "ansibrightblack", "red": "ansired bold", "yellow": "ansiyellow", "green": "ansigreen",
    "cyan": "ansicyan",
}  # fmt: skip


class Monitor:
    """What is on the screen: the store that all frames go to, and, while paused, a copy of it that stands still."""

    def __init__(self, name: str, watched: Watched, view: View) -> None:
        self._name = name
        self._watched = watched
        self.store = FrameStore(watched.decoder)
        self.view = view
        self._began_s = monotonic()
        self._still: tuple[FrameStore, Moment] | None = None
        #: who waits for a bus that is gone, since when (s, monotonic), and what ended the waiting
        self._waiting: threading.Thread | None = None
        self._gone_s = 0.0
        self._failure: DvtcliError | None = None
        self._leaving = threading.Event()

    def _moment(self) -> Moment:
        gone_s = monotonic() - self._gone_s if self._waiting is not None else None
        return Moment(self._name, monotonic() - self._began_s, self._watched.listener.dropped, time(), gone_s)

    def gather(self) -> None:
        """Take what has arrived; BusUnavailable where the bus failed and is not waited for."""
        if self._waiting is not None:
            if self._waiting.is_alive():
                return
            self._waiting = None
            if self._failure is not None:
                raise self._failure
            self.store = FrameStore(self._watched.decoder)  # nothing that was seen before counts
        try:
            for frame in self._watched.listener.take():
                self.store.take(frame)
        except BusUnavailable as failed:
            self._wait(failed)

    def _wait(self, failed: BusUnavailable) -> None:
        """Let a thread wait for the bus, which *failed*."""

        def wait() -> None:
            try:
                self._watched.come_back(failed, self._leaving.is_set)
            except DvtcliError as ended:
                self._failure = ended

        self._gone_s = monotonic()
        self._waiting = threading.Thread(target=wait, name="waiting for the bus", daemon=True)
        self._waiting.start()

    def leave(self) -> None:
        """Wait for the bus no longer."""
        self._leaving.set()
        if self._waiting is not None:
            self._waiting.join(_LEAVE_S)

    def pause(self) -> None:
        """Let the screen stand still, or go on; frames are counted on."""
        self.view.paused = not self.view.paused
        self._still = (deepcopy(self.store), self._moment()) if self.view.paused else None

    def choose(self, step: int) -> None:
        """Choose another signal."""
        last = len(chosen_signals(self._shown()[0], self.view)) - 1
        self.view.chosen = max(0, min(last, self.view.chosen + step))

    def _shown(self) -> tuple[FrameStore, Moment]:
        return self._still or (self.store, self._moment())

    def fragments(self, columns: int, rows: int) -> StyleAndTextTuples:
        """The screen as prompt_toolkit takes it."""
        store, moment = self._shown()
        drawn: StyleAndTextTuples = []
        for number, line in enumerate(picture(store, self.view, moment, columns, rows)):
            drawn.append(("", "\n" if number else ""))
            for cell in line:
                text = ascii_only(cell.text) if self.view.plain else cell.text
                drawn.append((f"class:{cell.style}" if cell.style else "", text))
        return drawn


def watch(session: Conversation, watched: Watched, wanted: str, duration_s: float | None, *, changes: bool) -> None:
    """Show the bus until q, Ctrl-C or the end of *duration_s*; BusUnavailable where it failed and is not waited for."""
    view = View(filter=wanted, plain=session.output.plain, changes=changes)
    monitor = Monitor(session.wire.name, watched, view)
    try:
        with _held_interrupts(), session.output.held():
            _application(monitor, duration_s, session.output.color).run()
    finally:
        monitor.leave()


@contextmanager
def _held_interrupts() -> Iterator[None]:
    """Keep SIGINT out of prompt_toolkit's starting and ending, where it breaks the event loop."""
    before = signal.signal(signal.SIGINT, lambda _number, _frame: None)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _application(monitor: Monitor, duration_s: float | None, color: str) -> Application[None]:
    from prompt_toolkit import Application
    from prompt_toolkit.layout import FormattedTextControl, Layout, Window
    from prompt_toolkit.output import ColorDepth
    from prompt_toolkit.styles import Style

    def size() -> tuple[int, int]:
        found = application.output.get_size()
        return found.columns, found.rows

    until_s = None if duration_s is None else monotonic() + duration_s

    def gather(application: Application[None]) -> None:
        if application.is_done:
            return
        try:
            monitor.gather()
        except DvtcliError as failed:  # raised here it would stay inside of prompt_toolkit's event loop
            application.exit(exception=failed)
            return
        if until_s is not None and monotonic() >= until_s:
            application.exit()

    application: Application[None] = Application(
        layout=Layout(Window(FormattedTextControl(lambda: monitor.fragments(*size())), always_hide_cursor=False)),
        key_bindings=_keys(monitor),
        style=Style.from_dict(STYLE),
        full_screen=True,
        refresh_interval=REDRAW_S,
        min_redraw_interval=REDRAW_S / 2,
        before_render=gather,
        color_depth=ColorDepth.DEPTH_1_BIT if color == "never" else None,
    )
    application.ttimeoutlen = 0.05
    return application


def _keys(monitor: Monitor) -> KeyBindings:
    from prompt_toolkit.filters import Condition
    from prompt_toolkit.key_binding import KeyBindings

    keys, view = KeyBindings(), monitor.view
    typing = Condition(lambda: view.typing)

    def bind(act: Callable[[], None], *names: str) -> None:
        for name in names:
            keys.add(name, filter=~typing)(lambda _event: act())

    bind(monitor.pause, "p", " ")
    bind(lambda: _look(view, RAW), "r")
    bind(lambda: _look(view, GRAPH), "g", "enter")
    bind(lambda: _look(view, TABLE), "t", "escape")
    bind(lambda: monitor.choose(-1), "up", "k")
    bind(lambda: monitor.choose(1), "down", "j")
    bind(lambda: monitor.choose(-10), "pageup")
    bind(lambda: monitor.choose(10), "pagedown")
    bind(monitor.store.forget, "c")
    bind(lambda: _type(view), "f", "/")

    @keys.add("q", filter=~typing)
    @keys.add("c-c")
    @keys.add("<sigint>")
    def _leave(event: KeyPressEvent) -> None:
        """Leave the monitor, and only it."""
        if event.app.is_running and not event.app.is_done:
            event.app.exit()

    _typing_keys(keys, monitor, typing)
    return keys


def _look(view: View, mode: str) -> None:
    """Show *mode*; the same key again goes back to the table."""
    view.mode = TABLE if view.mode == mode else mode
    view.top = 0


def _type(view: View) -> None:
    view.typing = True


def _typing_keys(keys: KeyBindings, monitor: Monitor, typing: object) -> None:
    """The keys of the filter's line."""
    from prompt_toolkit.filters import Filter

    assert isinstance(typing, Filter)  # noqa: S101 - for the type checker
    view = monitor.view

    def change(text: str) -> None:
        view.filter, view.chosen, view.top = text, 0, 0

    @keys.add("<any>", filter=typing)
    def _letter(event: KeyPressEvent) -> None:
        """One more letter."""
        if event.data.isprintable():
            change(view.filter + event.data)

    @keys.add("backspace", filter=typing)
    def _shorter(_event: KeyPressEvent) -> None:
        """One letter less."""
        change(view.filter[:-1])

    @keys.add("enter", filter=typing)
    def _keep(_event: KeyPressEvent) -> None:
        """Keep the filter."""
        view.typing = False

    @keys.add("escape", filter=typing)
    def _clear(_event: KeyPressEvent) -> None:
        """No filter."""
        view.typing = False
        change("")

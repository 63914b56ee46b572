"""The monitor's full screen: keys, redrawing, leaving. Knows prompt_toolkit; what is drawn is `screen`'s."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from time import monotonic, time
from typing import TYPE_CHECKING

from dvtcli.cli.monitor.screen import GRAPH, RAW, TABLE, Moment, View, chosen_signals, picture
from dvtcli.cli.view.glyphs import ascii_only
from dvtcli.errors import BusUnavailable
from dvtcli.watch.seen import FrameStore

if TYPE_CHECKING:
    from prompt_toolkit import Application
    from prompt_toolkit.formatted_text import StyleAndTextTuples
    from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent

    from dvtcli.cli.conversation import Conversation
    from dvtcli.watch.decoder import Decoder
    from dvtcli.watch.listener import Listener

#: the screen is drawn anew this often (s)
REDRAW_S = 0.1
STYLE = {
    "bold": "bold", "dim": "ansibrightblack", "red": "ansired bold", "yellow": "ansiyellow", "green": "ansigreen",
    "cyan": "ansicyan",
}  # fmt: skip


class Monitor:
    """What is on the screen: the store that all frames go to, and, while paused, a copy of it that stands still."""

    def __init__(self, name: str, listener: Listener, decoder: Decoder, view: View) -> None:
        self._name = name
        self._listener = listener
        self.store = FrameStore(decoder)
        self.view = view
        self._began_s = monotonic()
        self._still: tuple[FrameStore, Moment] | None = None

    def _moment(self) -> Moment:
        return Moment(self._name, monotonic() - self._began_s, self._listener.dropped, time())

    def gather(self) -> None:
        """Take what has arrived; BusUnavailable where the bus failed."""
        for frame in self._listener.take():
            self.store.take(frame)

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


def watch(
    session: Conversation, listener: Listener, decoder: Decoder, wanted: str, duration_s: float | None, *, changes: bool
) -> None:
    """Show the bus until q, Ctrl-C or the end of *duration_s*; BusUnavailable where it failed."""
    view = View(filter=wanted, plain=session.output.plain, changes=changes)
    monitor = Monitor(session.wire.name, listener, decoder, view)
    with _held_interrupts():
        _application(monitor, duration_s, session.output.color).run()


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
        except BusUnavailable as failed:  # raised here it would stay inside of prompt_toolkit's event loop
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

"""The monitor at a terminal, and its keys, by prompt_toolkit."""

from __future__ import annotations

from copy import deepcopy
from time import monotonic, time
from typing import TYPE_CHECKING

from prompt_toolkit.filters import Condition
from prompt_toolkit.key_binding import KeyBindings

from dvtcli.cli.monitor.full_screen import GoneBus, MappingReader, bind, bind_leaving, show
from dvtcli.cli.monitor.monitor_state import GRAPH, RAW, TABLE, Moment, View
from dvtcli.cli.monitor.screen import chosen_signals, picture
from dvtcli.cli.monitor.signal_lines import Lines
from dvtcli.errors import BusUnavailable
from dvtcli.operations.frames.explain_frame import described_nodes
from dvtcli.watch.frame_reader import FrameReader
from dvtcli.watch.seen import FrameStore

if TYPE_CHECKING:
    from prompt_toolkit.key_binding import KeyPressEvent

    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.frames.watch_bus import Watched


class Monitor:
    """The screen's contents: the store of all frames and, while paused, a frozen copy."""

    def __init__(self, name: str, watched: Watched, view: View) -> None:
        self._name = name
        self._watched = watched
        self.store = FrameStore(watched.decoder, watched.bitrate)
        self.view = view
        self._began_s = monotonic()
        self._still: tuple[FrameStore, Moment] | None = None
        self._reader = MappingReader(watched)
        self._words = FrameReader(watched.decoder, described_nodes(watched.session, watched.dbc))
        self._gone = GoneBus(watched.listener)

    def _moment(self) -> Moment:
        running_s, dropped = monotonic() - self._began_s, self._watched.listener.dropped
        return Moment(self._name, running_s, dropped, time(), self._gone.gone_s, self._reader.node)

    def gather(self) -> None:
        """Take new frames. Raises BusUnavailable if the bus failed and must not be waited for."""
        gone_s = self._gone.back_after_s()
        if self._gone.is_waiting():
            return
        if gone_s is not None:
            self._is_back(gone_s)
        news = self._reader.news()
        if news is not None:
            self.store.know(news)
            self._words.know(news)
        try:
            for frame in self._watched.listener.take():
                self.store.take(frame, self._words.read(frame))
        except BusUnavailable as failed:
            self._gone.wait(failed)

    def read_mappings(self) -> None:
        """Read the nodes' mappings again, unless already in progress."""
        if not self._gone.is_waiting() and not self._reader.is_reading:
            self._reader = MappingReader(self._watched)

    def _is_back(self, gone_s: float) -> None:
        """Reset all data, including mappings, after the bus is back."""
        self.store.gap(time(), f"the bus was gone for {gone_s:.0f} s: nothing was seen meanwhile")
        self._reader.stop()
        self._reader = MappingReader(self._watched)

    def leave(self) -> None:
        """Wait for the bus no longer, and read no more."""
        self._gone.leave()
        self._reader.stop()

    def pause(self) -> None:
        """Let the screen stand still, or go on; frames are counted on."""
        self.view.paused = not self.view.paused
        self._still = (deepcopy(self.store), self._moment()) if self.view.paused else None

    def choose(self, step: int) -> None:
        """Select another signal; after the last, scroll to the remaining frames."""
        self.view.choose(step, len(chosen_signals(self._shown()[0], self.view)))

    def _shown(self) -> tuple[FrameStore, Moment]:
        return self._still or (self.store, self._moment())

    def lines(self, columns: int, rows: int) -> Lines:
        """Return the screen of *columns* x *rows*."""
        store, moment = self._shown()
        return picture(store, self.view, moment, columns, rows)


def watch(session: Conversation, watched: Watched, view: View, duration_s: float | None) -> None:
    """Show the bus as *view* says until q, Ctrl-C or *duration_s*.

    Raises BusUnavailable if the bus failed and must not be waited for.
    """
    monitor = Monitor(session.wire.name, watched, view)
    show(session, monitor, _keys(monitor), duration_s)


def _keys(monitor: Monitor) -> KeyBindings:
    """Bind the keys."""
    keys, view = KeyBindings(), monitor.view

    def typing() -> bool:
        return view.typing

    bind(keys, monitor.pause, "p", " ", unless=typing)
    bind(keys, monitor.read_mappings, "m", unless=typing)
    bind(keys, lambda: _look(view, RAW), "r", unless=typing)
    bind(keys, lambda: _look(view, GRAPH), "g", "enter", unless=typing)
    bind(keys, lambda: _look(view, TABLE), "t", "escape", unless=typing)
    bind(keys, lambda: monitor.choose(-1), "up", "k", unless=typing)
    bind(keys, lambda: monitor.choose(1), "down", "j", unless=typing)
    bind(keys, lambda: monitor.choose(-10), "pageup", unless=typing)
    bind(keys, lambda: monitor.choose(10), "pagedown", unless=typing)
    bind(keys, monitor.store.forget, "c", unless=typing)
    bind(keys, lambda: _type(view), "f", "/", unless=typing)
    bind_leaving(keys, unless=typing)
    _typing_keys(keys, view)
    return keys


def _look(view: View, mode: str) -> None:
    """Show *mode*; the same key again goes back to the table."""
    view.mode = TABLE if view.mode == mode else mode
    view.top = view.beyond = 0


def _type(view: View) -> None:
    view.typing = True


def _typing_keys(keys: KeyBindings, view: View) -> None:
    """Bind the keys of the filter line."""
    typing = Condition(lambda: view.typing)

    def change(text: str) -> None:
        view.filter, view.chosen, view.top, view.beyond = text, 0, 0, 0

    @keys.add("<any>", filter=typing)
    def _letter(event: KeyPressEvent) -> None:
        """Add a letter."""
        if event.data.isprintable():
            change(view.filter + event.data)

    @keys.add("backspace", filter=typing)
    def _shorter(_event: KeyPressEvent) -> None:
        """Delete a letter."""
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

"""The monitor at a terminal, and its keys, by prompt_toolkit."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from functools import partial
from time import monotonic, time
from typing import TYPE_CHECKING

from prompt_toolkit.filters import Condition
from prompt_toolkit.key_binding import KeyBindings

from dvtcli.cli.monitor.actions import Actions
from dvtcli.cli.monitor.screen import chosen_row, chosen_signals, picture, signal_at
from dvtcli.cli.monitor.signal_lines import GRAPH, PICTURE, RAW, TABLE, Lines, Moment, View
from dvtcli.cli.screen.full_screen import GoneBus, MappingReader, bind, bind_all, bind_leaving, show
from dvtcli.cli.screen.widgets import cut
from dvtcli.errors import BusUnavailable
from dvtcli.operations.frames.transmit_rows import KEYS
from dvtcli.operations.network.described_nodes import described_nodes
from dvtcli.watch.frame_reader import FrameReader
from dvtcli.watch.seen import Event, FrameStore

if TYPE_CHECKING:
    from prompt_toolkit.key_binding import KeyPressEvent

    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.screen.widgets import Dialog
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.frames.watch_bus import Watched
    from dvtcli.watch.decoder import Address, Layout


#: rows of the picture at least, beside a dialog
_LEAST = 3


class Monitor:
    """The screen's contents: the store of all frames and, while paused, a frozen copy."""

    def __init__(self, session: Conversation, watched: Watched, view: View) -> None:
        self._session, self._name = session, session.wire.name
        self._watched = watched
        self.store = FrameStore(watched.decoder, watched.bitrate)
        self.view = view
        self._began_s = monotonic()
        self._still: tuple[FrameStore, Moment] | None = None
        self.actions = Actions(session, watched, self._last_data, self._layout)
        #: size of the screen as drawn last, and the first line of an open dialog
        self._rows, self._dialog_row = 0, 0
        self._reader = MappingReader(watched, self.actions.beside.turn)
        self._words = FrameReader(watched.decoder, described_nodes(watched.session, watched.dbc))
        self._gone = GoneBus(watched.listener)

    def _moment(self) -> Moment:
        running_s, dropped = monotonic() - self._began_s, self._watched.listener.dropped
        return Moment(self._name, running_s, dropped, time(), self._gone.gone_s, self._reader.node)

    def gather(self) -> None:
        """Take new frames, then messages about them. Raises BusUnavailable if the bus failed and is not waited for."""
        self._take_frames()
        self._take_messages()

    def _take_frames(self) -> None:
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
            taken = self._watched.listener.take()
        except BusUnavailable as failed:
            self._gone.wait(failed)
            return
        for frame in taken:
            self.store.take(frame, self._words.read(frame))
        self.actions.take(taken)

    def _take_messages(self) -> None:
        """Show what was said and is going on beside the screen."""
        self.actions.check()
        for text, bad in self.actions.beside.news():
            self.store.events.append(Event(time(), text, bad))
        self.view.marks = tuple(self.actions.marks())

    def _layout(self, frame: Frame) -> Layout:
        return self.store.decoder.layout(frame)

    def _last_data(self, address: Address) -> bytes | None:
        row = self.store.rows.get(address)
        return None if row is None or row.remote else row.data

    def read_mappings(self) -> None:
        """Read the nodes' mappings again, unless already in progress."""
        if not self._gone.is_waiting() and not self._reader.is_reading:
            self._reader = MappingReader(self._watched, self.actions.beside.turn)

    def _is_back(self, gone_s: float) -> None:
        """Reset all data, including mappings, after the bus is back."""
        self.actions.gap(gone_s, time())
        self.store.gap(time(), f"the bus was lost for {gone_s:.0f} s: no frames of that time")
        self._reader.stop()
        self._reader = MappingReader(self._watched, self.actions.beside.turn)

    def leave(self) -> None:
        """Wait for the bus no longer, and read no more."""
        self._gone.leave()
        self._reader.stop()
        self.actions.leave()

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
        dialog = self.actions.dialog()
        self._rows = self._dialog_row = rows
        if dialog is None:
            return picture(store, self.view, moment, columns, rows)
        block = dialog_lines(dialog, self.view, columns, rows)
        self._rows = max(_LEAST, rows - len(block) + 1)
        self._dialog_row = self._rows - 1
        return [*picture(store, self.view, moment, columns, self._rows)[:-1], *block]

    def nmt(self) -> None:
        """Ask for an NMT command to the node of the chosen signal, else the selected node, else all nodes."""
        found = chosen_row(self._shown()[0], self.view)
        signal = None if found is None else found[1]
        node_id = found[0].service.node if found is not None and signal is not None else self._session.selected_id()
        names = self.store.decoder.names
        received = (seen.service.node for seen in self.store.rows.values())
        self.actions.nmt(node_id, {**{received_id: "" for received_id in received if received_id}, **names})

    def mouse(self, act: str, _column: int, row: int) -> None:
        """Scroll by the wheel and choose by a click, in a dialog if one is open."""
        dialog = self.actions.dialog()
        if act == "click" and dialog is not None and row >= self._dialog_row:
            dialog.click(row - self._dialog_row)
        elif act == "click":
            store, moment = self._shown()
            number = signal_at(store, self.view, moment, self._rows, row)
            if number is not None:
                self.view.chosen, self.view.beyond = number, 0
        elif dialog is not None:
            self.actions.press(act, "")
        else:
            self.choose(-3 if act == "wheel-up" else 3)


def dialog_lines(dialog: Dialog, view: View, columns: int, rows: int) -> Lines:
    """Return the lines of *dialog*, which stand instead of the keys on a screen of *columns* x *rows*."""
    return [cut(line, columns, plain=view.plain) for line in dialog.lines(columns, max(1, rows - _LEAST))]


def watch(session: Conversation, watched: Watched, view: View, duration_s: float | None) -> None:
    """Show the bus as *view* says until q, Ctrl-C or *duration_s*.

    Raises BusUnavailable if the bus failed and must not be waited for.
    """
    monitor = Monitor(session, watched, view)
    show(session, monitor, _keys(monitor), duration_s, monitor.mouse)


def _keys(monitor: Monitor) -> KeyBindings:
    """Bind the keys."""
    keys, view, actions = KeyBindings(), monitor.view, monitor.actions

    def asked() -> bool:
        return actions.dialog() is not None

    def typing() -> bool:
        return view.typing or asked()

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
    bind(keys, lambda: _look(view, PICTURE), "i", unless=typing)
    bind(keys, monitor.nmt, "n", unless=typing)
    bind(keys, actions.sync, "y", unless=typing)
    bind(keys, actions.transmit_list, "x", unless=typing)
    bind(keys, actions.record, "l", unless=typing)
    for key in KEYS:
        bind(keys, partial(actions.send_by_key, key), key, unless=typing)
    bind_leaving(keys, unless=typing)
    _typing_keys(keys, view, asked)
    bind_all(keys, actions.press, asked)
    return keys


def _look(view: View, mode: str) -> None:
    """Show *mode*; the same key again goes back to the table."""
    view.mode = TABLE if view.mode == mode else mode
    view.top = view.beyond = 0


def _type(view: View) -> None:
    view.typing = True


def _typing_keys(keys: KeyBindings, view: View, asked: Callable[[], bool]) -> None:
    """Bind the keys of the filter line, which a question interrupts."""
    typing = Condition(lambda: view.typing and not asked())

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

"""`watch` at a terminal, and its keys, by prompt_toolkit."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from copy import deepcopy
from time import monotonic, time
from typing import TYPE_CHECKING

from prompt_toolkit.key_binding import KeyBindings

from dvtcli.cli.monitor.full_screen import LEAVE_S, GoneBus, MappingReader, bind, bind_leaving, show
from dvtcli.cli.monitor.monitor_state import GRAPH, TABLE, Moment, View
from dvtcli.cli.monitor.signal_lines import Lines
from dvtcli.cli.monitor.watch_screen import Board, WatchedPdo, shown_values, watch_picture
from dvtcli.domain.abort import abort_text
from dvtcli.errors import BusUnavailable, DvtcliError
from dvtcli.watch.decoder import Signal
from dvtcli.watch.seen import FrameStore
from dvtcli.watch.watched_object import WatchedObject

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.frames.watch_bus import Watched
    from dvtcli.operations.objects.watch_objects import ObjectRound
    from dvtcli.operations.results import ValueRead


class ObjectReader:
    """Reads each of *objects* every *every_s* seconds in a thread; slow reads skip periods.

    A lost bus ends the thread silently: the listener reports it. `take` raises any other error.
    """

    def __init__(self, objects: ObjectRound, every_s: float) -> None:
        self._objects = objects
        self._every_s = every_s
        self._found: deque[tuple[int, float, ValueRead | DvtcliError]] = deque(maxlen=10_000)
        self._failure: BaseException | None = None
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._read, name="reading objects", daemon=True)
        self._thread.start()

    def _read(self) -> None:
        try:
            self._read_on()
        except BusUnavailable:
            pass
        except BaseException as failed:  # noqa: BLE001 - nobody sees what ends a thread: `take` raises it
            self._failure = failed

    def _read_on(self) -> None:
        next_s = monotonic()
        while not self._stopping.wait(max(0.0, next_s - monotonic())):
            for number in range(len(self._objects.objects)):
                if self._stopping.is_set():
                    return
                try:
                    found: ValueRead | DvtcliError = self._objects.read(number)
                except BusUnavailable:
                    raise
                except DvtcliError as failed:
                    found = failed
                self._found.append((number, time(), found))
            next_s = max(next_s + self._every_s, monotonic())

    def take(self) -> list[tuple[int, float, ValueRead | DvtcliError]]:
        """Return all reads since the last call: object number, time (s since 1970), value or error.

        After the last read, raises the error that ended the thread.
        """
        if not self._found and self._failure is not None:
            raise self._failure
        return [self._found.popleft() for _ in range(len(self._found))]

    def stop(self) -> None:
        """Read no more."""
        self._stopping.set()
        self._thread.join(LEAVE_S)


class WatchScreen:
    """The screen's contents: the board and, while paused, a frozen copy."""

    def __init__(
        self, watched: Watched, objects: ObjectRound, pdos: Sequence[WatchedPdo], every_s: float, view: View
    ) -> None:
        self._watched, self._objects = watched, objects
        rows = [
            WatchedObject(node_id, Signal(f"{index:04X}:{sub:02X}", "", f"{index:04X}:{sub:02X}"))
            for node_id, index, sub in objects.objects
        ]
        self.board = Board(rows, pdos, FrameStore(watched.decoder), every_s)
        self.view = view
        self._name = watched.session.wire.name
        self._began_s = monotonic()
        self._still: tuple[Board, Moment] | None = None
        self._gone = GoneBus(watched.listener)
        self._begin()

    def _begin(self) -> None:
        self._mappings = MappingReader(self._watched) if self.board.pdos else None
        self._reader = ObjectReader(self._objects, self.board.every_s) if self.board.objects else None

    def _end(self) -> None:
        for reader in (self._mappings, self._reader):
            if reader is not None:
                reader.stop()

    def _moment(self) -> Moment:
        reading = None if self._mappings is None else self._mappings.node
        return Moment(self._name, monotonic() - self._began_s, 0, time(), self._gone.gone_s, reading)

    def gather(self) -> None:
        """Take new data. Raises BusUnavailable if the bus failed and must not be waited for."""
        back_after_s = self._gone.back_after_s()
        if self._gone.is_waiting():
            return
        if back_after_s is not None:
            self.board.store.gap(time(), "")
            self._end()
            self._begin()
        news = None if self._mappings is None else self._mappings.news()
        if news is not None:
            self.board.store.know(news)
        for number, at_s, found in () if self._reader is None else self._reader.take():
            _note(self.board.objects[number], at_s, found)
        try:
            for frame in self._watched.listener.take():
                self.board.store.take(frame)
        except BusUnavailable as failed:
            self._gone.wait(failed)

    def read_mappings(self) -> None:
        """Read the mappings again, unless already in progress."""
        if self._mappings is not None and not self._mappings.is_reading and not self._gone.is_waiting():
            self._mappings = MappingReader(self._watched)

    def pause(self) -> None:
        """Let the screen stand still, or go on; values are taken on."""
        self.view.paused = not self.view.paused
        self._still = (deepcopy(self.board), self._moment()) if self.view.paused else None

    def choose(self, step: int) -> None:
        """Choose another value."""
        last = len(shown_values(self._shown()[0])) - 1
        self.view.chosen = max(0, min(last, self.view.chosen + step))

    def leave(self) -> None:
        """Wait for the bus no longer, and read no more."""
        self._gone.leave()
        self._end()

    def _shown(self) -> tuple[Board, Moment]:
        return self._still or (self.board, self._moment())

    def lines(self, columns: int, rows: int) -> Lines:
        """Return the screen of *columns* x *rows*."""
        board, moment = self._shown()
        return watch_picture(board, self.view, moment, columns, rows)


def _note(watched: WatchedObject, at_s: float, found: ValueRead | DvtcliError) -> None:
    if isinstance(found, DvtcliError):
        watched.fail(found.text if found.abort is None else f"refused: {abort_text(found.abort)}")
    else:
        watched.take(
            Signal(found.object, found.name, found.object, found.meaning, 8 * len(found.raw)), found.value, at_s
        )


def watch_screen(
    session: Conversation,
    watched: Watched,
    objects: ObjectRound,
    pdos: Sequence[WatchedPdo],
    every_s: float,
    duration_s: float | None,
) -> None:
    """Show *objects* and *pdos* until q, Ctrl-C or the end of *duration_s*; BusUnavailable as the monitor."""
    screen = WatchScreen(watched, objects, pdos, every_s, View(plain=session.output.plain))
    show(session, screen, _keys(screen), duration_s)


def _keys(screen: WatchScreen) -> KeyBindings:
    keys, view = KeyBindings(), screen.view

    def look(mode: str) -> None:
        view.mode = TABLE if view.mode == mode else mode
        view.top = 0

    bind(keys, screen.pause, "p", " ")
    bind(keys, lambda: look(GRAPH), "g", "enter")
    bind(keys, lambda: look(TABLE), "t", "escape")
    bind(keys, lambda: screen.choose(-1), "up", "k")
    bind(keys, lambda: screen.choose(1), "down", "j")
    bind(keys, lambda: screen.choose(-10), "pageup")
    bind(keys, lambda: screen.choose(10), "pagedown")
    bind(keys, screen.read_mappings, "m")
    bind(keys, screen.board.forget, "c")
    bind_leaving(keys)
    return keys

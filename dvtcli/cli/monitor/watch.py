"""`watch` at a terminal: its picture and its keys, by prompt_toolkit."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from time import monotonic, time
from typing import TYPE_CHECKING

from prompt_toolkit.key_binding import KeyBindings

from dvtcli.cli.monitor.graph import graph
from dvtcli.cli.monitor.screen import GRAPH_S, head_line, scrolled
from dvtcli.cli.monitor.signal_lines import (
    FRESH_S,
    GRAPH,
    TABLE,
    Lines,
    Moment,
    View,
    age,
    levels,
    rate_text,
    value_of,
    with_more,
)
from dvtcli.cli.screen.full_screen import LEAVE_S, GoneBus, MappingReader, bind, bind_leaving, show
from dvtcli.cli.screen.widgets import cut, filled
from dvtcli.cli.view.lines import Cell
from dvtcli.domain.abort import abort_text
from dvtcli.domain.cob_id import can_id_text
from dvtcli.errors import BusUnavailable, DvtcliError
from dvtcli.watch.decoder import Signal
from dvtcli.watch.seen import FrameStore, SeenFrame
from dvtcli.watch.statistics import ValueHistory, WatchedObject, physical_points, spark

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


#: a watched PDO: node-ID and label (`TPDO1`)
WatchedPdo = tuple[int, str]
#: columns of a sparkline: in 80 columns, and at most
_SPARK, _LONG_SPARK = 8, 60
#: columns of a value
_VALUE = 15


@dataclass(frozen=True, slots=True)
class _Shown:
    """A line's value with its origin."""

    node: int
    signal: Signal
    history: ValueHistory
    read_s: float | None
    problem: str = ""


@dataclass(slots=True)
class Board:
    """The watched values: *objects* by SDO every *every_s* seconds, *pdos* by frames in *store*."""

    objects: Sequence[WatchedObject]
    pdos: Sequence[WatchedPdo]
    store: FrameStore
    every_s: float

    def row(self, pdo: WatchedPdo) -> SeenFrame | None:
        """Return the frames of *pdo*, None if none was received."""
        rows = self.store.rows.values()
        return next((row for row in rows if (row.service.node, row.service.label) == pdo), None)

    def forget(self) -> None:
        """Begin anew with all statistics."""
        self.store.forget()
        for watched_object in self.objects:
            watched_object.history.forget()


def watch_picture(board: Board, view: View, moment: Moment, width: int, height: int) -> Lines:
    """The whole screen: header, values, keys; *height* lines (3 and more) of at most *width* columns."""
    room = max(0, height - 3)
    draw = _graph if view.mode == GRAPH else _table
    body = draw(board, view, moment, width, room)
    body += [[] for _ in range(room - len(body))]
    lines = [
        head_line("WATCH", moment, _state(board, view, moment), width),
        _heads(width),
        *body[:room],
        _key_line(view),
    ]
    return [cut(line, width, plain=view.plain) for line in lines]


def shown_values(board: Board) -> list[_Shown]:
    """Return all values with a line, in order of the screen."""
    found = [
        _Shown(
            watched_object.node,
            watched_object.signal,
            watched_object.history,
            watched_object.read_s,
            watched_object.problem,
        )
        for watched_object in board.objects
    ]
    return found + [signal for pdo in board.pdos for signal in _signals(board, pdo)]


def _signals(board: Board, pdo: WatchedPdo) -> Iterator[_Shown]:
    row = board.row(pdo)
    if row is not None:
        for signal, history in zip(row.layout.signals, row.histories, strict=True):
            yield _Shown(pdo[0], signal, history, row.last_s)


def _state(board: Board, view: View, moment: Moment) -> list[Cell]:
    cells: list[Cell] = []
    if board.objects:
        cells.append(Cell(f"SDO every {1000 * board.every_s:g} ms  " if board.every_s < 1 else _seconds(board.every_s)))
    if moment.gone_s is not None:
        cells.append(Cell(f"LOST for {moment.gone_s:.0f} s, waiting for it  ", "red"))
    if moment.reading is not None:
        cells.append(Cell(f"reading the mapping of node {moment.reading}...  ", "cyan"))
    if view.paused:
        cells.append(Cell("PAUSED", "yellow"))
    return cells


def _seconds(every_s: float) -> str:
    return f"SDO every {every_s:g} s  "


def _heads(width: int) -> list[Cell]:
    name, long = _widths(width)
    return [Cell(f"  {'OBJECT':<11} {'NAME':<{name}} {'VALUE':>15}     AGE  {'TREND':<{long}}  MIN .. MAX", "dim")]


def _widths(width: int) -> tuple[int, int]:
    """Return the columns of name and sparkline."""
    name = max(10, min(40, width - 68))
    return name, max(_SPARK, min(_LONG_SPARK, width - 70 - name))


def _key_line(view: View) -> list[Cell]:
    keys = [("p", "go on" if view.paused else "pause"), ("↑↓", "choose"), ("g", "graph"), ("m", "mappings")]
    keys += [("c", "clear"), ("q", "quit")]
    return [cell for key, what in keys for cell in (Cell(f" {key}", "bold"), Cell(f" {what} "))]


def _table(board: Board, view: View, moment: Moment, width: int, room: int) -> Lines:
    shown = shown_values(board)
    view.chosen = max(0, min(view.chosen, len(shown) - 1))
    lines: Lines = []
    places: list[int] = []
    for shown_value in shown[: len(board.objects)]:
        places.append(len(lines))
        lines.append(_line(shown_value, view, moment, width, chosen=len(places) - 1 == view.chosen))
    for pdo in board.pdos:
        lines.append(_pdo_line(board, pdo, moment))
        for signal in _signals(board, pdo):
            places.append(len(lines))
            lines.append(_line(signal, view, moment, width, chosen=len(places) - 1 == view.chosen))
    view.top = scrolled(view.top, places[view.chosen] if places else 0, len(lines), room)
    return lines[view.top :]


def _pdo_line(board: Board, pdo: WatchedPdo, moment: Moment) -> list[Cell]:
    node, label = pdo
    title, row = Cell(f"{label} node {node}", "bold"), board.row(pdo)
    if row is None:
        return [title, Cell("  no frame yet", "yellow")]
    rate = rate_text(row.rhythm.rate_hz(moment.now_s))
    said = f"  {rate}" if rate else ""
    can_id = can_id_text(row.can_id, extended=row.extended)
    return [
        title,
        Cell(
            f"  {can_id}{said}  {row.count} frames  {row.data.hex(' ').upper()}",
            "dim",
        ),
    ]


def _line(one: _Shown, view: View, moment: Moment, width: int, *, chosen: bool) -> list[Cell]:
    name_width, long = _widths(width)
    name = filled(one.signal.name, name_width, plain=view.plain)
    old = "" if one.read_s is None else age(moment.now_s - one.read_s)
    cells = [
        Cell("> " if chosen else "  ", "cyan"),
        Cell(f"{f'{one.node}:{one.signal.object}':<11} {name} "),
    ]
    if one.problem:
        return [*cells, Cell(one.problem, "red")]
    value = value_of(one.signal, one.history, _VALUE)
    fresh = one.history.changed_s == one.read_s or moment.now_s - one.history.changed_s < FRESH_S
    drawn = spark([point.last for point in list(one.history.points)[-long:]], levels(view))
    cells += [
        Cell(f"{value:>{_VALUE}}{'*' if fresh else ' '}", "yellow" if fresh else ""),
        Cell(f" {old:>7}  ", "dim"),
        Cell(f"{drawn:<{long}}  ", "green"),
    ]
    return with_more(cells, one.signal, one.history, width)


def _graph(board: Board, view: View, moment: Moment, width: int, room: int) -> Lines:
    shown = shown_values(board)
    if not shown:
        return [[Cell("  nothing to draw: no value received yet", "dim")]]
    one = shown[max(0, min(view.chosen, len(shown) - 1))]
    title = f"node {one.node}  {one.signal.object}  {one.signal.name}".rstrip()
    if one.history.low is None:
        return [[Cell(title, "bold"), Cell(f"  {one.problem or 'no number received yet'}", "dim")]]
    span_s = (moment.now_s - GRAPH_S, moment.now_s)
    ends = f"-{GRAPH_S:g} s", "now"
    points = physical_points(one.history.points, one.signal.meaning)
    drawn = graph(points, width, max(4, room - 1), span_s, ends=ends, plain=view.plain)
    head = [Cell(title, "bold"), Cell(f"  {value_of(one.signal, one.history, width)}   ", "yellow")]
    return [with_more(head, one.signal, one.history, width), *([Cell(line)] for line in drawn)]

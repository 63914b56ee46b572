"""The picture of `watch`: chosen objects and PDOs as lines for a screen of a given size. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from dvtcli.cli.monitor.graph import graph
from dvtcli.cli.monitor.monitor_state import GRAPH, Moment, View
from dvtcli.cli.monitor.room import cut, filled
from dvtcli.cli.monitor.screen import GRAPH_S, head_line, scrolled
from dvtcli.cli.monitor.signal_lines import FRESH_S, Lines, age, levels, value_of, with_more
from dvtcli.cli.view.lines import Cell
from dvtcli.watch.decoder import Signal
from dvtcli.watch.seen import FrameStore, SeenFrame
from dvtcli.watch.statistics import ValueHistory, physical_points, spark
from dvtcli.watch.watched_object import WatchedObject

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
    course: ValueHistory
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
            watched_object.course.forget()


def watch_picture(board: Board, view: View, moment: Moment, width: int, height: int) -> Lines:
    """The whole screen: header, values, keys; *height* lines (3 and more) of at most *width* columns."""
    room = max(0, height - 3)
    draw = _graph if view.mode == GRAPH else _table
    body = draw(board, view, moment, width, room)
    body += [[] for _ in range(room - len(body))]
    lines = [head_line("WATCH", moment, _state(board, view, moment), width), _heads(width), *body[:room], _keys(view)]
    return [cut(line, width, plain=view.plain) for line in lines]


def shown_values(board: Board) -> list[_Shown]:
    """Return all values with a line, in order of the screen."""
    found = [
        _Shown(
            watched_object.node,
            watched_object.signal,
            watched_object.course,
            watched_object.read_s,
            watched_object.problem,
        )
        for watched_object in board.objects
    ]
    return found + [signal for pdo in board.pdos for signal in _signals(board, pdo)]


def _signals(board: Board, pdo: WatchedPdo) -> Iterator[_Shown]:
    row = board.row(pdo)
    if row is not None:
        for signal, course in zip(row.layout.signals, row.courses, strict=True):
            yield _Shown(pdo[0], signal, course, row.last_s)


def _state(board: Board, view: View, moment: Moment) -> list[Cell]:
    cells: list[Cell] = []
    if board.objects:
        cells.append(Cell(f"SDO every {1000 * board.every_s:g} ms  " if board.every_s < 1 else _seconds(board.every_s)))
    if moment.gone_s is not None:
        cells.append(Cell(f"GONE for {moment.gone_s:.0f} s, waiting for it  ", "red"))
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


def _keys(view: View) -> list[Cell]:
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
    rate = row.rhythm.rate_hz(moment.now_s)
    said = "" if rate is None else f"  {rate:.1f} Hz"
    return [title, Cell(f"  0x{row.can_id:03X}{said}  {row.count} frames  {row.data.hex(' ').upper()}", "dim")]


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
    value = value_of(one.signal, one.course, _VALUE)
    fresh = one.course.changed_s == one.read_s or moment.now_s - one.course.changed_s < FRESH_S
    drawn = spark([point.last for point in list(one.course.points)[-long:]], levels(view))
    cells += [
        Cell(f"{value:>{_VALUE}}{'*' if fresh else ' '}", "yellow" if fresh else ""),
        Cell(f" {old:>7}  ", "dim"),
        Cell(f"{drawn:<{long}}  ", "green"),
    ]
    return with_more(cells, one.signal, one.course, width)


def _graph(board: Board, view: View, moment: Moment, width: int, room: int) -> Lines:
    shown = shown_values(board)
    if not shown:
        return [[Cell("  nothing to draw: no value came yet", "dim")]]
    one = shown[max(0, min(view.chosen, len(shown) - 1))]
    title = f"node {one.node}  {one.signal.object}  {one.signal.name}".rstrip()
    if one.course.low is None:
        return [[Cell(title, "bold"), Cell(f"  {one.problem or 'no number came yet'}", "dim")]]
    span_s = (moment.now_s - GRAPH_S, moment.now_s)
    ends = f"-{GRAPH_S:g} s", "now"
    points = physical_points(one.course.points, one.signal.meaning)
    drawn = graph(points, width, max(4, room - 1), span_s, ends=ends, plain=view.plain)
    head = [Cell(title, "bold"), Cell(f"  {value_of(one.signal, one.course, width)}   ", "yellow")]
    return [with_more(head, one.signal, one.course, width), *([Cell(line)] for line in drawn)]

"""The monitor's picture: a store's frames as lines for a screen of a given size. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from dvtcli.cli.monitor.graph import graph
from dvtcli.cli.monitor.signal_lines import (
    GRAPH,
    PICTURE,
    RAW,
    TABLE,
    Lines,
    Moment,
    View,
    faded,
    frame_lines,
    heads,
    is_silent,
    row_line,
    signal_line,
    title_of,
    value_of,
    with_more,
)
from dvtcli.cli.screen.widgets import cut, wide
from dvtcli.cli.view.lines import Cell, clipped, columns
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.text import plural
from dvtcli.domain.times import local_clock
from dvtcli.watch.decoder import Signal
from dvtcli.watch.seen import Event, FrameStore, SeenFrame
from dvtcli.watch.statistics import HIGH_LOAD, ValueHistory, physical_points

#: columns of each node's name to try, longest first; last none
_NAMES = (60, 30, 20, 14, 10, 0)
_STATE_STYLES: dict[NmtState | None, str] = {NmtState.OPERATIONAL: "green", None: "dim"}


def node_line(store: FrameStore, reading: int | None, width: int, *, plain: bool) -> list[Cell]:
    """Return the nodes on the bus or known, with names and states; *reading* marks a node being read.

    If space is short, states are abbreviated, then names are cut and dropped. Last, nodes are grouped by state, rare
    states first, listed by number or only counted.
    """
    names, received = store.decoder.names, {row.service.node for row in store.rows.values()}
    shown = sorted({node for node in received if node is not None} | set(names))
    states = {node: store.states.get(node) for node in shown}
    before = [Cell(f"reading the mapping of node {reading}...  ", "cyan")] if reading is not None else []
    if not shown:
        return [*before, Cell("no node is seen", "dim")]
    room = width - wide([before], plain=plain) if before else width
    return [*before, *_fitting(names, states, room, plain=plain)]


def _fitting(names: Mapping[int, str], states: Mapping[int, NmtState | None], width: int, *, plain: bool) -> list[Cell]:
    """Return all nodes of *states* in *width* columns, with *names* as long as possible."""
    for most, short in ((_NAMES[0], False), *((most, True) for most in _NAMES)):
        nodes = [_node_cells(one, names.get(one, ""), state, most, short=short) for one, state in states.items()]
        if wide(nodes, plain=plain) <= width:
            return [cell for group in nodes for cell in group]
    return _by_state(states, width, plain=plain)


def _node_cells(node_id: int, name: str, state: NmtState | None, most: int, *, short: bool) -> list[Cell]:
    """Return a node with its name, of at most *most* columns, and its state, abbreviated if *short*."""
    label = f"{node_id} {clipped(name, most)}" if name and most else f"{node_id}" if not most else f"node {node_id}"
    said = f" {state.short if short else state.label}   " if state is not None else "   "
    return [Cell(label, "bold"), Cell(said, _STATE_STYLES.get(state, "yellow"))]


def _by_state(states: Mapping[int, NmtState | None], width: int, *, plain: bool) -> list[Cell]:
    """Group nodes by state, rarest first; the most common are counted if their numbers do not fit."""
    members: dict[NmtState | None, list[int]] = {}
    for node, state in states.items():
        members.setdefault(state, []).append(node)
    groups = sorted(members, key=lambda state: (len(members[state]), members[state]))
    for listed in range(len(groups), -1, -1):
        cells = [
            _group(ranges(members[state]) if at < listed else plural(len(members[state]), "node"), state)
            for at, state in enumerate(groups)
        ]
        if wide(cells, plain=plain) <= width:
            return [cell for group in cells for cell in group]
    return [Cell(plural(len(states), "node"), "yellow")]


def _group(who: str, state: NmtState | None) -> list[Cell]:
    said = "no heartbeat" if state is None else state.short
    return [Cell(who, "bold"), Cell(f" {said}   ", _STATE_STYLES.get(state, "yellow"))]


def ranges(nodes: Iterable[int]) -> str:
    """Return node-IDs in order, with ranges: `1-5,9`."""
    runs: list[list[int]] = []
    for node in nodes:
        if runs and node == runs[-1][-1] + 1:
            runs[-1].append(node)
        else:
            runs.append([node])
    return ",".join(f"{run[0]}" if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)


#: maximum number of events
EVENTS = 4
#: minimum rows for the line of nodes and the column heads
ABOVE_FROM = 12
#: time span of a graph (s)
GRAPH_S = 60.0
#: minimum columns of the bus's name
SHORTEST_NAME = 12
#: an SDO exchange keeps its line for this time (s) after its end: most are dvtcli's own at the start
IDLE_S = 5.0


def picture(store: FrameStore, view: View, moment: Moment, width: int, height: int) -> Lines:
    """The whole screen: header, body, events, keys; *height* lines (3 and more) of at most *width* columns."""
    events = [_event_line(event) for event in list(store.events)[-EVENTS:]]
    events = events[len(events) - min(len(events), max(0, height // 4)) :]
    above = [head_line("MONITOR", moment, _state(store, view, moment), width)]
    if has_heads(view, height):
        above += [node_line(store, moment.reading, width, plain=view.plain), heads(width)]
    room = max(0, height - 1 - len(above) - len(events))
    body = _BODIES.get(view.mode, _table)(store, view, moment, width, room)
    body += [[] for _ in range(room - len(body))]
    lines = [*above, *body[:room], *events, _keys(view, width)]
    return [cut(line, width, plain=view.plain) for line in lines]


def has_heads(view: View, height: int) -> bool:
    """Whether the line of nodes and the column heads are shown."""
    return view.mode not in (GRAPH, PICTURE) and height >= ABOVE_FROM


def signal_at(store: FrameStore, view: View, moment: Moment, height: int, row: int) -> int | None:
    """Return the number of the signal on the screen's line *row* of *height*, of a frame's line that of its first.

    None for other lines, and for frames without signals.
    """
    if view.mode in (GRAPH, PICTURE):
        return None
    line = row - (3 if has_heads(view, height) else 1) + view.top + view.beyond
    rows = list(_table_rows(store, view, moment))
    numbers = rows[line][2] if 0 <= line < len(rows) and row < height - 1 else range(0)
    return numbers.start if numbers else None


def chosen_signals(store: FrameStore, view: View) -> list[tuple[SeenFrame, Signal, ValueHistory]]:
    """Return the signals passing the filter, in order of the screen."""
    return [
        (row, signal, history)
        for row in _rows(store, view)
        for signal, history in _shown(store, row, view.filter.lower())
        if row.service.kind != "sdo"
    ]


def _rows(store: FrameStore, view: View) -> list[SeenFrame]:
    """Return the rows of the kinds of frames that are shown."""
    rows = store.sorted_rows()
    return [row for row in rows if row.reading.is_one_of(view.only)] if view.only else rows


def _shown(store: FrameStore, row: SeenFrame, wanted: str) -> list[tuple[Signal, ValueHistory]]:
    """Return the signals of *row* passing the filter: all if the frame's own name matches."""
    pairs = list(zip(row.layout.signals, row.histories, strict=True))
    if wanted in title_of(row, store.decoder.called).lower():
        return pairs
    return [pair for pair in pairs if wanted in f"{pair[0].key} {pair[0].object}".lower()]


def head_line(title: str, moment: Moment, state: list[Cell], width: int) -> list[Cell]:
    """*title*, the bus, and *state*; of the bus's name as much as leaves room for the state."""
    rest = [Cell(f"  {clock(moment.running_s)}  "), *state]
    room = width - len(title) - 1 - sum(columns(cell.text) for cell in rest)
    return [Cell(f"{title} ", "bold"), Cell(clipped(moment.name, max(room, SHORTEST_NAME))), *rest]


def _state(store: FrameStore, view: View, moment: Moment) -> list[Cell]:
    cells: list[Cell] = []
    if moment.gone_s is not None:
        cells.append(Cell(f"LOST for {moment.gone_s:.0f} s, waiting for it  ", "red"))
    cells.append(Cell(f"{store.frames} frames  "))
    if moment.gone_s is None:
        cells += _business(store, moment)
    cells.append(Cell(f"{moment.dropped} dropped", "red" if moment.dropped else "dim"))
    if store.unlisted:
        cells.append(Cell(f"  {store.unlisted} of more CAN-IDs", "yellow"))
    if view.paused:
        cells.append(Cell("  PAUSED", "yellow"))
    cells += [Cell(f"  {mark}", "green") for mark in view.marks]
    if view.filter and not view.typing:
        cells.append(Cell(f"  filter: {view.filter}", "cyan"))
    return cells


def _business(store: FrameStore, moment: Moment) -> list[Cell]:
    """Return frames per second, and the load if the bit rate is known."""
    share = store.load.share(moment.now_s)
    cells = [Cell(f"{store.load.frames_a_second(moment.now_s):.0f}/s  ")]
    return cells if share is None else [*cells, Cell(f"load {share:.0%}  ", "yellow" if share > HIGH_LOAD else "")]


#: keys that a narrow screen leaves out, first of all the first
_OBVIOUS = ("↑↓", "c", "m", "g", "r", "l", "i")


def _keys(view: View, width: int) -> list[Cell]:
    """Return the line of keys; the most obvious are left out if *width* is too small."""
    if view.typing:
        return [Cell("filter: ", "cyan"), Cell(f"{view.filter}_"), Cell("   Enter keep  Esc clear", "dim")]
    keys = [("p", "go on" if view.paused else "pause"), ("f", "filter"), ("r", "raw"), ("g", "graph"), ("i", "frame")]
    keys += [("n", "NMT"), ("y", "SYNC"), ("x", "send"), ("l", "log"), ("↑↓", "choose"), ("m", "mappings")]
    keys += [("c", "clear"), ("q", "quit")]
    for obvious in _OBVIOUS:
        if sum(len(key) + len(what) + 3 for key, what in keys) > width:
            keys = [(key, what) for key, what in keys if key != obvious]
    return [cell for key, what in keys for cell in (Cell(f" {key}", "bold"), Cell(f" {what} "))]


def _event_line(event: Event) -> list[Cell]:
    at = local_clock(event.time_s, "milliseconds")
    style = "red" if event.bad else ""
    return [Cell("! " if event.bad else "  ", style), Cell(f"{at}  ", "dim"), Cell(event.text, style)]


def _table(store: FrameStore, view: View, moment: Moment, width: int, room: int) -> Lines:
    lines: Lines = []
    at_chosen = 0
    for row, pair, numbers in _table_rows(store, view, moment):
        chosen = view.chosen in numbers
        at_chosen = len(lines) if chosen else at_chosen
        if pair is None:
            lines.append(row_line(row, store, moment, width, with_words=view.mode != RAW))
        else:
            line = signal_line(*pair, view, moment, width, chosen=chosen)
            lines.append(faded(line) if is_silent(row, moment) else line)
    idle = sum(_is_idle(row, view, moment) for row in _rows(store, view))
    if idle:
        lines.append([Cell(f"  {plural(idle, 'idle SDO row')} left out: f sdo shows them", "dim")])
    view.top = scrolled(view.top, at_chosen, len(lines), room)
    view.beyond = min(view.beyond, max(0, len(lines) - room - view.top))
    nothing = "  nothing matches the filter" if store.rows else "  nothing yet"
    return lines[view.top + view.beyond :] or [[Cell(nothing, "dim")]]


def _is_idle(row: SeenFrame, view: View, moment: Moment) -> bool:
    return row.service.kind == "sdo" and not view.filter and moment.now_s - row.last_s > IDLE_S


def _table_rows(
    store: FrameStore, view: View, moment: Moment
) -> Iterator[tuple[SeenFrame, tuple[Signal, ValueHistory] | None, range]]:
    """Yield the table's lines: the frame, its signal with the history (None: the frame's own line), and numbers.

    The numbers are those of the signal, on the frame's own line of all its signals.
    """
    wanted, number = view.filter.lower(), 0
    for row in _rows(store, view):
        signals = _shown(store, row, wanted)
        is_called = wanted in title_of(row, store.decoder.called).lower()
        if _is_idle(row, view, moment) or not (signals or is_called):
            continue
        yield row, None, range(number, number + len(signals))
        for pair in signals:
            if view.mode == TABLE:
                yield row, pair, range(number, number + 1)
            number += 1


def scrolled(top: int, chosen: int, count: int, room: int) -> int:
    """Return the first line to show, so that the selected line and its frame's line are visible."""
    top = min(top, max(0, count - room))
    if chosen - 1 < top:
        return max(0, chosen - 1)
    return max(top, chosen - room + 1)


def clock(seconds: float) -> str:
    """A time as hours, minutes and seconds."""
    return f"{int(seconds) // 3600:02}:{int(seconds) // 60 % 60:02}:{int(seconds) % 60:02}"


def _graph(store: FrameStore, view: View, moment: Moment, width: int, room: int) -> Lines:
    signals = chosen_signals(store, view)
    if not signals:
        return [[Cell("  no signal to draw: nothing decoded yet, or nothing matches the filter", "dim")]]
    row, signal, history = signals[min(view.chosen, len(signals) - 1)]
    title = f"{title_of(row, store.decoder.called)}  {signal.object}  {signal.name}".rstrip()
    now = Cell(f"  {value_of(signal, history, width)}   ", "yellow")
    if history.low is None:
        return [[Cell(title, "bold"), now], [Cell("  no number received yet", "dim")]]
    span_s = (moment.now_s - GRAPH_S, moment.now_s)
    ends = f"-{GRAPH_S:g} s", "now"
    points = physical_points(history.points, signal.meaning)
    drawn = graph(points, width, max(4, room - 1), span_s, ends=ends, plain=view.plain)
    return [with_more([Cell(title, "bold"), now], signal, history, width), *([Cell(line)] for line in drawn)]


def chosen_row(store: FrameStore, view: View) -> tuple[SeenFrame, Signal | None] | None:
    """Return the frame of the chosen signal with the signal; without signals the first frame; None without frames."""
    signals = chosen_signals(store, view)
    if signals:
        row, signal, _ = signals[min(view.chosen, len(signals) - 1)]
        return row, signal
    rows = _rows(store, view)
    return (rows[0], None) if rows else None


def _picture(store: FrameStore, view: View, moment: Moment, width: int, room: int) -> Lines:
    found = chosen_row(store, view)
    if found is None:
        return [[Cell("  nothing yet", "dim")]]
    lines = frame_lines(*found, store, view, moment, width)
    marked = next((number for number, line in enumerate(lines) if line and line[0].text == "  > "), 0)
    view.top = scrolled(view.top, marked, len(lines), room)
    return lines[view.top :]


_BODIES = {GRAPH: _graph, PICTURE: _picture, TABLE: _table, RAW: _table}

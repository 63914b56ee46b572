"""The monitor's view settings, and its lines of a frame: signals, bytes and objects with live values. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from dvtcli.cli.screen.widgets import filled, least_and_most
from dvtcli.cli.view.answers.pdo_lines import cell_width, picture
from dvtcli.cli.view.lines import Cell, clipped, columns
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.object_scalings import value_text
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig
from dvtcli.domain.text import safe
from dvtcli.operations.results.pdos import MappedName, PdoRow
from dvtcli.watch.decoder import Signal
from dvtcli.watch.seen import FrameStore, SeenFrame
from dvtcli.watch.statistics import GRACE_S, ValueHistory, spark

#: a change is bright for this long (s)
FRESH_S = 0.5
#: columns of a value on a narrow and on a WIDE screen
VALUE, LONG_VALUE, WIDE = 16, 20, 100
#: the rate and the period of a frame that is overdue
SILENT = "-"
#: columns of a frame's title and rate
_BEFORE_RATE = 32
#: columns of a node's name in a frame's line
NAME = 12
_LEVELS, _PLAIN_LEVELS = "▁▂▃▄▅▆▇█", "_.-=+*#@"
#: points of a sparkline in up to 100 columns and in many more
SPARK, LONG_SPARK = 8, 60
Lines = list[list[Cell]]


def title_of(row: SeenFrame, called: Mapping[int, str]) -> str:
    """Return a row's CAN-ID, kind of frame, and node, by its name in *called* if it has one."""
    number = row.service.node
    node = "" if not number else f" {clipped(safe(called[number]), NAME)}" if number in called else f" node {number}"
    return f"0x{row.can_id:0{8 if row.extended else 3}X} {row.service.label}{node}"


def row_line(row: SeenFrame, store: FrameStore, moment: Moment, width: int, *, with_words: bool = False) -> list[Cell]:
    """Return a frame's line, with the node's name if space permits; *with_words*: what it says goes before bytes."""
    rate, jitter = row.rhythm.rate_hz(moment.now_s), row.rhythm.jitter_s()
    title = title_of(row, store.decoder.called)
    text = rate_text(rate)
    spread = "" if jitter is None or not rate else f"±{1000 * jitter:.{1 if jitter < 0.1 else 0}f} ms"
    period = SILENT if is_silent(row, moment) else "" if not rate else period_text(1 / rate)
    number = row.service.node or 0
    name = "" if number in store.decoder.called else store.decoder.names.get(number, "")
    cells = [
        Cell(title, "bold"),
        Cell(text.rjust(max(len(text) + 1, _BEFORE_RATE - len(title)))),
        Cell(f" {period:>8}"),
        *([Cell(f" {spread:>8}", "dim")] if width >= WIDE else ()),
        Cell(f" {_count(row.count):>6}"),
        Cell(f" {age(moment.now_s - row.last_s):>6}  ", "dim"),
    ]
    data, words = list(_bytes(row, moment)), [Cell(f"{row.reading.text} ")] if with_words and row.reading.text else []
    is_wide = not words or sum(columns(cell.text) for cell in (*cells, *data, *words)) <= width
    cells += [*(data if is_wide else ()), *words]
    named = Cell(f"{'' if row.remote else '   ' * (8 - len(row.data))} {name}", "dim")
    cells = [*cells, named] if sum(columns(cell.text) for cell in (*cells, named)) <= width else cells
    return faded(cells) if is_silent(row, moment) else cells


def is_silent(row: SeenFrame, moment: Moment) -> bool:
    """Whether the frame is overdue by several of its periods."""
    return moment.now_s - row.last_s > GRACE_S and row.rhythm.rate_hz(moment.now_s) == 0


def rate_text(rate: float | None) -> str:
    """Frames per second in words; `-` for a frame that is overdue, empty if unknown."""
    if rate is None:
        return ""
    return SILENT if rate == 0 else f"{rate:.1f} Hz" if rate < 1000 else f"{rate:.0f} Hz"


def faded(line: list[Cell]) -> list[Cell]:
    """Return *line* without bright colours, except the mark of the chosen signal."""
    return [cell if cell.style == "cyan" else Cell(cell.text, "dim") for cell in line]


def heads(width: int) -> list[Cell]:
    """Return the heads of the columns of `row_line`; a narrow screen has no jitter."""
    jitter = f"{'JITTER':>9}" if width >= WIDE else ""
    return [Cell(f"{'FRAME':<24}{'RATE':>8}{'PERIOD':>9}{jitter}{'COUNT':>7}{'AGE':>7}  BYTES", "dim")]


def period_text(seconds: float) -> str:
    """The time between two frames, on at most eight characters."""
    return f"{1000 * seconds:.1f} ms" if seconds < 0.99995 else f"{seconds:.2f} s" if seconds < 1000 else "long"


def levels(view: View) -> str:
    """Return the characters of a sparkline, lowest first."""
    return _PLAIN_LEVELS if view.plain else _LEVELS


def _count(number: int) -> str:
    return str(number) if number < 1_000_000 else f"{number / 1e6:.1f}M"


def age(seconds: float) -> str:
    """How long ago something was, on at most six characters."""
    seconds = max(0.0, seconds)
    if seconds < 99.95:
        return f"{seconds:.1f} s"
    return f"{seconds:.0f} s" if seconds < 600 else f"{seconds / 60:.0f} min" if seconds < 60000 else "long"


def _bytes(row: SeenFrame, moment: Moment) -> Iterator[Cell]:
    if row.remote:
        yield Cell("remote request", "dim")
        return
    for byte, changed_s in zip(row.data, row.changed_s, strict=True):
        yield Cell(f"{byte:02X} ", "yellow" if moment.now_s - changed_s < FRESH_S else "")


def signal_line(
    signal: Signal, history: ValueHistory, view: View, moment: Moment, width: int, *, chosen: bool
) -> list[Cell]:
    """Return a signal's line: object, name, value, sparkline, and details; marked if *chosen*."""
    value_width = VALUE if width < WIDE else LONG_VALUE
    name_width = max(10, min(40, width - 43 - value_width))
    fresh = moment.now_s - history.changed_s < FRESH_S
    long = max(SPARK, min(LONG_SPARK, width - 77 - value_width))
    drawn = spark([point.last for point in list(history.points)[-long:]], levels(view))
    return with_more(
        [
            Cell("  > " if chosen else "    ", "cyan"),
            Cell(f"{signal.object:<7}  {filled(signal.name, name_width, plain=view.plain)} "),
            Cell(f"{value_of(signal, history, value_width):>{value_width}}  ", "yellow" if fresh else ""),
            Cell(f"{drawn:<{long}}  ", "green"),
        ],
        signal, history, width,
    )  # fmt: skip


def value_of(signal: Signal, history: ValueHistory, width: int) -> str:
    """Return a signal's value, without the raw value if over *width* columns; a statusword's raw value."""
    meaning, last = signal.meaning, history.last
    if isinstance(last, int) and _words(signal, history):
        return meaning.raw_text(last, signal.bits)
    text = value_text(last, meaning, signal.bits)
    return meaning.quantity(last) if len(text) > width and isinstance(last, int | float) else text


def with_more(line: list[Cell], signal: Signal, history: ValueHistory, width: int) -> list[Cell]:
    """Append minimum and maximum to *line* within *width* columns; for a statusword its state."""
    more = _words(signal, history)
    if not more and history.low is not None and history.high is not None:
        room = width - sum(columns(cell.text) for cell in line)
        more = least_and_most(signal.meaning, history.low, history.high, room)
    return [*line, Cell(more, "dim")]


def _words(signal: Signal, history: ValueHistory) -> str:
    """Return the state in a statusword or similar; empty for a number."""
    meaning, last = signal.meaning, history.last
    return meaning.words(last) if isinstance(last, int) and not meaning.has_number else ""


def frame_lines(
    row: SeenFrame, chosen: Signal | None, store: FrameStore, view: View, moment: Moment, width: int
) -> Lines:
    """Return the lines of *row*: period, count and age, its bytes in their places, and each signal's values."""
    lines: Lines = [[Cell(title_of(row, store.decoder.called), "bold")], _times(row, moment)]
    if row.layout.mapping:
        lines += [[Cell(text)] for text in picture(_pdo_row(row), max(79, width))]
    lines.append(_picture_bytes(row, moment, max(79, width)))
    for signal, history in zip(row.layout.signals, row.histories, strict=True):
        lines.append(signal_line(signal, history, view, moment, width, chosen=signal is chosen))
    return lines


def _times(row: SeenFrame, moment: Moment) -> list[Cell]:
    """Return count, age, and the period with its minimum and maximum of the last frames."""
    gaps = row.rhythm.gaps()
    cells = [Cell(f"  {row.count} frames, the last {age(moment.now_s - row.last_s)} ago")]
    if gaps:
        period = 1000 * sum(gaps) / len(gaps)
        cells.append(Cell(f", every {period:.1f} ms", "yellow"))
        cells.append(Cell(f" ({1000 * min(gaps):.1f} .. {1000 * max(gaps):.1f} of the last {len(gaps)})", "dim"))
    return cells


def _pdo_row(row: SeenFrame) -> PdoRow:
    """Return the PDO of *row*, as its picture needs it."""
    parameter = PdoCommunicationParameter(CobId(row.can_id, extended=row.extended))
    signals = {signal.object: signal for signal in row.layout.signals}
    names = tuple(
        MappedName(signal.name, signal.data_type.short if signal.data_type else "", signal.meaning)
        if (signal := signals.get(entry.object)) is not None
        else MappedName()
        for entry in row.layout.mapping
    )
    return PdoRow(Pdo.parse(row.layout.pdo or "tpdo1"), PdoConfig(parameter, row.layout.mapping), names)


def _picture_bytes(row: SeenFrame, moment: Moment, width: int) -> list[Cell]:
    """Return the bytes, each below its place in the picture; changed bytes are bright."""
    cells = [Cell("data   ", "dim")]
    if row.remote:
        return [*cells, Cell("remote request", "dim")]
    for byte, changed_s in zip(row.data, row.changed_s, strict=True):
        fresh = moment.now_s - changed_s < FRESH_S
        cells.append(Cell(f"{f'{byte:02X}':^{cell_width(width) - 1}} ", "yellow" if fresh else ""))
    return cells


TABLE, RAW, GRAPH, PICTURE = "table", "raw", "graph", "picture"


@dataclass(slots=True)
class View:
    """How the user looks at it: *mode*, the *filter* (being typed while *typing*), and the *chosen* signal's number."""

    mode: str = TABLE
    filter: str = ""
    typing: bool = False
    paused: bool = False
    chosen: int = 0
    plain: bool = False
    changes: bool = False
    #: kinds of frames that are shown, as in `typed_frame.READ_KINDS`; none: all
    only: frozenset[str] = frozenset()
    #: the first visible line of the body
    top: int = 0
    #: lines scrolled beyond the last signal
    beyond: int = 0
    #: what the keys started, in words
    marks: tuple[str, ...] = ()

    def choose(self, step: int, count: int) -> None:
        """Select another of *count* signals; after the last scroll, and scroll back first."""
        place = self.chosen + self.beyond + step
        self.chosen = max(0, min(count - 1, place))
        self.beyond = 0 if self.mode in (GRAPH, PICTURE) else max(0, place - self.chosen)


@dataclass(frozen=True, slots=True)
class Moment:
    """The moment of the picture: bus *name*, seconds since start, frames *dropped*, and time (s since 1970).

    *gone_s* is the time since the bus was lost (s), None if present; *reading* is the node whose mapping is being read.
    """

    name: str
    running_s: float
    dropped: int
    now_s: float
    gone_s: float | None = None
    reading: int | None = None

"""The text of frames, decoded or for `-v` and `-vv`, and of plots; frames as JSON, a line each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.abort import abort_text
from dvtcli.domain.can_ids import SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.object_scalings import NOTHING, value_text
from dvtcli.domain.ports import Frame
from dvtcli.domain.text import join_some, plural
from dvtcli.domain.times import local_clock, utc
from dvtcli.domain.typed_frame import frame_text
from dvtcli.operations.results.documents import hex_bytes, json_value, physical_document
from dvtcli.operations.results.frames import (
    BusEvent,
    FrameExplained,
    FrameSeen,
    FramesSent,
    Outcome,
    Plotted,
    Replayed,
    Traced,
    reading_document,
)

if TYPE_CHECKING:
    from dvtcli.domain.datatypes import Value
    from dvtcli.domain.scaling import Scaling
    from dvtcli.watch.frame_reader import Reading


def explained_lines(result: FrameExplained, width: int) -> Iterator[Line]:
    """Show the frame, its kind, and a line per part."""
    text = result.short if result.reading.text else ""
    yield [Cell(f"{frame_text(result.frame)}  "), Cell(result.what, "bold"), Cell(f": {text}" if text else "")]
    table = Table(("PLACE", "RAW", "NAME", "SAYS"), shrink=3)
    for part in result.parts:
        name = f"{part.name}  {part.object}" if part.object and part.object != part.name else part.name
        table.add(Cell(part.place, "dim"), part.raw_text, name, Cell(part.text, "bold"))
    yield from table.lines(width)


def trace_lines(result: Traced, _width: int) -> Iterator[Line]:
    """Show a line per frame: time, node, bytes, and a short meaning."""
    began_s = result.frames[0].frame.frame.timestamp_s if result.frames else 0.0
    for frame in result.frames:
        at_ms = (frame.frame.frame.timestamp_s - began_s) * 1000
        yield [
            Cell(f"{at_ms:9.1f} ms  ", "dim"),
            Cell(f"{'->' if frame.sent else '<-'} {frame_text(frame.frame.frame):<20}  "),
            Cell(f"{frame.frame.what}  ", "bold"),
            Cell(frame.frame.short + ("  (its value is not shown)" if frame.secret else "")),
        ]


def sent_lines(result: FramesSent, _width: int) -> Iterator[Line]:
    """How many frames were sent, and how late; under --dry-run that none was."""
    if not result.dry_run:
        yield outcome_text(result.outcome)
        return
    asked = [frame for frame in result.frames if frame.effects]
    yield f"dry run: nothing was sent; nodes act on {len(asked)} of {plural(len(result.frames), 'frame')}"
    for frame in asked:
        yield f"  {frame_text(frame.explained.frame)}: {frame.effects}"


def replayed_lines(result: Replayed, width: int) -> Iterator[Line]:
    """Show the number of frames sent and left out, and delays; with --dry-run a table of frames to send."""
    if result.dry_run:
        yield f"dry run: none of {plural(result.outcome.wanted, 'frame')} was sent"
        table = Table(("COB-ID", "WHAT", "FRAMES", "ASKED BECAUSE"), frozenset({2}), shrink=3, wraps=True)
        for row in result.frames:
            can_id = f"0x{row.can_id:0{8 if row.extended else 3}X}"
            what = f"{row.label}{f', node {row.node}' if row.node else ''}{', remote' if row.remote else ''}"
            said = ": ".join(filter(None, (row.effects, join_some(row.words))))
            table.add(can_id, what, str(row.count), said)
        yield from table.lines(width)
    else:
        yield outcome_text(result.outcome)
    if result.left_out:
        yield f"left out: {', '.join(f'{reason} ({count})' for reason, count in result.left_out)}"


def outcome_text(outcome: Outcome) -> str:
    """Return the number of frames sent, the total, the time, and the delay."""
    said = outcome.counted
    said += " handed to the interface" if outcome.sent is None else " sent"
    if outcome.handed > 1:
        said += f" in {outcome.seconds:.2f} s"
    if outcome.late_s is not None and outcome.nearly_s is not None and outcome.handed > 1:
        said += f", at most {outcome.late_s * 1000:.1f} ms late (99 %: {outcome.nearly_s * 1000:.1f} ms)"
    return said


def frame_lines(result: FrameSeen, _width: int) -> Iterable[Line]:
    """Show a frame with local time and UTC offset, kind, bytes and signals."""
    frame = result.frame
    words = result.reading.text
    if not words and result.signals:
        scaling_of = result.scalings.get
        words = "  ".join(
            [f"{name}={value_text(value, scaling_of(name, NOTHING))}" for name, value in result.signals.items()]
        )
    data = "remote request" if frame.remote else frame.data.hex(" ").upper() or ("" if words else "no data")
    cells = [
        Cell(f"{local_clock(frame.timestamp_s, 'microseconds')}  ", "dim"),
        *_who(frame.can_id, frame.extended, result.label, result.node),
        Cell(f"{data:<23}  {words}" if words else f"{data:<23}"),
    ]
    mapped = result.mapped_bytes
    if mapped is not None:
        cells.append(Cell(f"  [{plural(len(frame.data), 'byte')}, {mapped} mapped]", "yellow"))
    return (cells,)


@lru_cache(maxsize=4096)
def _who(can_id: int, extended: bool, label: str, node: int | None) -> tuple[Cell, Cell]:
    """Return a frame's CAN-ID and kind."""
    who = f"{label} node {node}" if node else label
    return Cell(f"0x{can_id:0{8 if extended else 3}X}  "), Cell(f"{who:<18}  ", "bold")


def bus_event_lines(result: BusEvent, _width: int) -> Iterator[Line]:
    """Show a lost or restored bus."""
    yield result.text


def plot_lines(result: Plotted, _width: int) -> Iterator[Line]:
    """Show each signal with minimum, maximum and graph; or the picture's path."""
    for signal in result.signals:
        low, high = signal.meaning.number_text(signal.low), signal.meaning.number_text(signal.high)
        spread = f"{low} .. {high} {signal.meaning.unit}".rstrip()
        yield [
            Cell(signal.name, "bold"),
            Cell(f"  {signal.object}" if signal.object and signal.object != signal.name else ""),
            Cell(f"  {spread}, {signal.count} samples in {result.seconds:.2f} s", "dim"),
        ]
        yield from signal.drawing
    if result.output is not None:
        yield f"{result.output}: {len(result.signals)} signal{'' if len(result.signals) == 1 else 's'} drawn"


#: start of an expedited value (bytes); segments of longer values start earlier
_VALUE = 4


def traffic_line(frame: Frame, verbose: int, *, sent: bool, secret: slice | None = None) -> str | None:
    """The line for *frame*: with *verbose* 1 only what begins or ends an SDO, from 2 on every frame.

    The bytes *secret* are not shown.
    """
    if verbose > 1:
        way = "->" if sent else "<-"
        kind = " remote" if frame.remote else ""
        length = frame.dlc if frame.remote else len(frame.data)
        hidden = range(8)[secret] if secret is not None else ()
        shown = " ".join("**" if at in hidden else f"{byte:02X}" for at, byte in enumerate(frame.data))
        return f"{way} {can_id_text(frame.can_id, extended=frame.extended)} [{length}]{kind} {shown}"
    base, node_id = frame.can_id & 0x780, frame.can_id & 0x7F
    if frame.extended or len(frame.data) < 8 or base not in (SDO_REQUEST_BASE, SDO_RESPONSE_BASE):
        return None
    if secret is not None:
        return f"sdo {node_id}  {_object(frame.data)} <- (not shown)" if secret.start == _VALUE else None
    words = _request(frame.data) if base == SDO_REQUEST_BASE else _answer(frame.data)
    return None if words is None else f"sdo {node_id}  {words}"


def _object(data: bytes) -> str:
    return f"0x{int.from_bytes(data[1:3], 'little'):04X}:{data[3]:02X}"


def _payload(data: bytes) -> str:
    """Return the bytes of an expedited transfer, or the length of a segmented transfer (CiA 301, 7.2.4.3)."""
    command = data[0]
    if not command & 2:
        return f"{int.from_bytes(data[4:8], 'little')} bytes in segments" if command & 1 else "in segments"
    size = 4 - (command >> 2 & 3) if command & 1 else 4
    return data[4 : 4 + size].hex(" ").upper()


def _request(data: bytes) -> str | None:
    match data[0] >> 5:
        case 1:
            return f"{_object(data)} <- {_payload(data)}"
        case 2:
            return f"{_object(data)} ?"
        case 4:
            return f"{_object(data)} aborted: {abort_text(int.from_bytes(data[4:8], 'little'))}"
    return None


def _answer(data: bytes) -> str | None:
    match data[0] >> 5:
        case 2:
            return f"{_object(data)} =  {_payload(data)}"
        case 3:
            return f"{_object(data)} written"
        case 4:
            code = int.from_bytes(data[4:8], "little")
            return f"{_object(data)} abort 0x{code:08X}: {abort_text(code)}"
    return None


Encode = Callable[[Any], str]
#: stands for a changing value when the constant parts are encoded; none of the parts before them comes from a file
_CHANGING = "changing"
#: values of a signal whose text is kept: most signals keep a value for many frames
_REMEMBERED = 64


class FrameJson:
    """The text of each frame's document, `dvtcli.frame/1`; *encode* makes the JSON text of any value."""

    def __init__(self, encode: Encode) -> None:
        self._encode = encode
        #: by CAN-ID, and names of the signals: a short frame lacks the last ones
        self._templates: dict[tuple[int, bool, tuple[str, ...]], _Template] = {}

    def text(self, seen: FrameSeen) -> str:
        """The JSON text of `seen.document()`."""
        if not seen.signals:
            return self._encode(seen.document())
        key = seen.frame.can_id, seen.frame.extended, tuple(seen.signals)
        template = self._templates.get(key)
        if template is None or not template.is_of(seen):
            template = self._templates[key] = _Template(seen, self._encode)
        return template.text(seen)


class _Template:
    """The constant parts of the documents of one CAN-ID's frames, from its frame *first*."""

    def __init__(self, first: FrameSeen, encode: Encode) -> None:
        self._first, self._encode = first, encode
        changing = dict.fromkeys(("time", "data", "signals", "physical"), _CHANGING)
        words = reading_document(first.reading)
        constant = {key: value for key, value in (first.document() | changing).items() if key not in words}
        self._parts = encode(constant).removesuffix("}").split(f'"{_CHANGING}"', len(changing))
        self._keys = [f"{encode(name)}:" for name in first.signals]
        scaled = {name: meaning for name, meaning in first.scalings.items() if name in first.signals}
        self._physical = [(name, _physical_text(name, meaning, encode)) for name, meaning in scaled.items()]
        self._reading, self._words = first.reading, self._words_of(first.reading)

    def is_of(self, seen: FrameSeen) -> bool:
        """Whether the constant parts are those of *seen*, too."""
        first = self._first
        return (
            seen.scalings is first.scalings
            and seen.objects is first.objects
            and seen.layout_from is first.layout_from
            and seen.layout_is_guess is first.layout_is_guess
            and (seen.kind, seen.node, seen.pdo) == (first.kind, first.node, first.pdo)
            and seen.frame.remote is first.frame.remote
        )

    def text(self, seen: FrameSeen) -> str:
        """The JSON text of *seen*, a frame with these constant parts."""
        if seen.reading is not self._reading:
            self._reading, self._words = seen.reading, self._words_of(seen.reading)
        before, after_time, after_data, after_signals, rest = self._parts
        signals = seen.signals
        values = ",".join([
            f"{key}{value}" if type(value) is int else key + self._encode(json_value(value))  # a BOOLEAN is an int, too
            for key, value in zip(self._keys, signals.values(), strict=True)
        ])  # fmt: skip
        physical = ",".join([text(signals[name]) for name, text in self._physical])
        return (
            f'{before}"{utc(seen.frame.timestamp_s)}"{after_time}"{hex_bytes(seen.frame.data)}"{after_data}{{{values}}}'
            f"{after_signals}{{{physical}}}{rest},{self._words}"
        )

    def _words_of(self, reading: Reading) -> str:
        return self._encode(reading_document(reading)).removeprefix("{")


def _physical_text(name: str, meaning: Scaling, encode: Encode) -> Callable[[Value], str]:
    """What returns the text of `physical_document` of a value, after the signal's *name*."""
    key = f"{encode(name)}:"
    if not meaning.has_number or meaning.values or meaning.states or meaning.bits:
        return lambda value: key + encode(physical_document(value, meaning))
    unit = encode(f" {meaning.unit}".rstrip())[1:-1]
    before, after = f'{key}{{"value":', f'{unit}","bits":[]}}'
    between = f',"unit":{encode(meaning.unit)},"text":"'

    @lru_cache(maxsize=_REMEMBERED)
    def text_of_integer(value: int) -> str:
        return f"{before}{meaning.number(value)!r}{between}{meaning.number_text(value)}{after}"

    def text(value: Value) -> str:
        if type(value) is int:
            return text_of_integer(value)
        # a REAL may be infinite, or -0.0, which equals 0.0; a BOOLEAN has another text
        return key + encode(physical_document(value, meaning))

    return text

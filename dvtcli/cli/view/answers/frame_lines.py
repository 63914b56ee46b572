"""The text of frames, decoded or for `-v` and `-vv`, and of plots."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.abort import abort_text
from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.object_scalings import NOTHING, value_text
from dvtcli.domain.ports import Frame
from dvtcli.domain.text import join_some, plural
from dvtcli.domain.times import local_clock
from dvtcli.domain.typed_frame import frame_text
from dvtcli.operations.results.frames import BusEvent, FrameExplained, FrameSeen, Plotted, Traced
from dvtcli.operations.results.sent import FramesSent, Outcome, Replayed


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


_REQUEST, _ANSWER = 0x600, 0x580
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
    if frame.extended or len(frame.data) < 8 or base not in (_REQUEST, _ANSWER):
        return None
    if secret is not None:
        return f"sdo {node_id}  {_object(frame.data)} <- (not shown)" if secret.start == _VALUE else None
    words = _request(frame.data) if base == _REQUEST else _answer(frame.data)
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

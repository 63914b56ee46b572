"""The text of frames and of plots."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

from dvtcli.cli.view.lines import Cell, Line
from dvtcli.domain.meanings import NOTHING
from dvtcli.domain.several import plural
from dvtcli.domain.shown_value import value_text
from dvtcli.domain.wall_clock import local_clock
from dvtcli.operations.results.bus_events import BusEvent
from dvtcli.operations.results.frames import FrameSeen, Plotted


def frame_lines(result: FrameSeen, _width: int) -> Iterator[Line]:
    """A frame with its local time of day and its offset, what it is, its bytes and its signals."""
    frame = result.frame
    data = "remote request" if frame.remote else frame.data.hex(" ").upper()
    signals = "  ".join(
        [f"{name}={value_text(value, result.meanings.get(name, NOTHING))}" for name, value in result.signals.items()]
    )
    cells = [
        Cell(f"{local_clock(frame.timestamp_s, 'microseconds')}  ", "dim"),
        *_who(frame.can_id, frame.extended, result.label, result.node),
        Cell(f"{data:<23}  {signals}" if signals else f"{data:<23}"),
    ]
    mapped = result.mapped_bytes
    if mapped is not None:
        cells.append(Cell(f"  [{plural(len(frame.data), 'byte')}, {mapped} mapped]", "yellow"))
    yield cells


@lru_cache(maxsize=4096)
def _who(can_id: int, extended: bool, label: str, node: int | None) -> tuple[Cell, Cell]:
    """The CAN-ID of a frame, and what it is."""
    who = f"{label} node {node}" if node else label
    return Cell(f"0x{can_id:0{8 if extended else 3}X}  "), Cell(f"{who:<18}  ", "bold")


def bus_event_lines(result: BusEvent, _width: int) -> Iterator[Line]:
    """A bus that is gone, or back."""
    yield result.text


def plot_lines(result: Plotted, _width: int) -> Iterator[Line]:
    """Each signal with its least and most, and its drawing; or where the picture is."""
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

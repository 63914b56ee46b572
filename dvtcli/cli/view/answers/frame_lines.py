"""The text of frames and of plots."""

from __future__ import annotations

from collections.abc import Iterator

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
    at = local_clock(frame.timestamp_s, "microseconds")
    node = f" node {result.node}" if result.node else ""
    data = "remote request" if frame.remote else frame.data.hex(" ").upper()
    signals = "  ".join(
        f"{name}={value_text(value, result.meanings.get(name, NOTHING))}" for name, value in result.signals.items()
    )
    mapped = result.mapped_bytes
    yield [
        Cell(f"{at}  ", "dim"),
        Cell(f"0x{frame.can_id:0{8 if frame.extended else 3}X}  "),
        Cell(f"{f'{result.label}{node}':<18}  ", "bold"),
        Cell(f"{data:<23}"),
        Cell(f"  {signals}" if signals else ""),
        Cell("" if mapped is None else f"  [{plural(len(frame.data), 'byte')}, {mapped} mapped]", "yellow"),
    ]


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

"""The monitor's picture of one frame: its bytes, the objects in them, and their live values. Pure."""

from __future__ import annotations

from dvtcli.cli.monitor.monitor_state import Moment, View
from dvtcli.cli.monitor.signal_lines import FRESH_S, Lines, age, signal_line, title_of
from dvtcli.cli.view.answers.pdo_lines import cell_width, picture
from dvtcli.cli.view.lines import Cell
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig
from dvtcli.operations.results.pdos import MappedName, PdoRow
from dvtcli.watch.decoder import Signal
from dvtcli.watch.seen import FrameStore, SeenFrame


def frame_lines(
    row: SeenFrame, chosen: Signal | None, store: FrameStore, view: View, moment: Moment, width: int
) -> Lines:
    """Return the lines of *row*: period, count and age, its bytes in their places, and each signal's values."""
    lines: Lines = [[Cell(title_of(row, store.decoder.called), "bold")], _times(row, moment)]
    if row.layout.mapping:
        lines += [[Cell(text)] for text in picture(_pdo_row(row), max(79, width))]
    lines.append(_bytes(row, moment, max(79, width)))
    for signal, course in zip(row.layout.signals, row.courses, strict=True):
        lines.append(signal_line(signal, course, view, moment, width, chosen=signal is chosen))
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


def _bytes(row: SeenFrame, moment: Moment, width: int) -> list[Cell]:
    """Return the bytes, each below its place in the picture; changed bytes are bright."""
    cells = [Cell("data   ", "dim")]
    if row.remote:
        return [*cells, Cell("remote request", "dim")]
    for byte, changed_s in zip(row.data, row.changed_s, strict=True):
        fresh = moment.now_s - changed_s < FRESH_S
        cells.append(Cell(f"{f'{byte:02X}':^{cell_width(width) - 1}} ", "yellow" if fresh else ""))
    return cells

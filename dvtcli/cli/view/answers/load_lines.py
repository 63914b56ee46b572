"""The text of `load`: each frame with computed and measured load, and the sum."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.network.worst_case_load import NO_LIMIT, NO_SYNC, UNKNOWN_TYPE
from dvtcli.domain.text import join_some, plural

if TYPE_CHECKING:
    from dvtcli.domain.network.worst_case_load import Stream, StreamLoad
    from dvtcli.operations.results.networks import FrameLoad, Measured, NetworkLoad

#: width of a bar, and width with measured values before it
_BAR, _NARROW = 12, 5
#: columns of a row with bars and measured values
_WHOLE = 100
#: columns of a row with bars but no measured values
_BARRED = 92
_HEADER = ("COB-ID", "WHAT", "NODE", "LEN", "AT MOST", "LOAD", "RESPONSE", "DEADLINE")
_HEARD = ("HEARD/S", "LOAD")


def load_lines(result: NetworkLoad, width: int) -> Iterator[Line]:
    """Show a line per frame, the sum, frames that do not fit, and assumptions."""
    measured = result.measured if result.measured is not None and result.measured.seconds else None
    rate = f"{result.need.bit_rate / 1000:g} kbit/s"
    assumed = " (assumed: -b sets another)" if result.is_assumed else ""
    received = f"; {result.bus}: {measured.count.frames} frames in {measured.seconds:.1f} s" if measured else ""
    yield [Cell(f"{result.file or result.bus} at {rate}{assumed}, at worst{received}", "bold")]
    yield from _table(result, measured, width).lines(width)
    yield from _sums(result, measured)
    yield from (([Cell("  ", ""), Cell(f"assumed: {text}", "dim")]) for text in result.need.assumed)


def _table(result: NetworkLoad, measured: Measured | None, width: int) -> Table:
    """A row a frame; on a narrow screen what can be done without goes."""
    if measured and width < _WHOLE:
        return _narrow_table(result, measured)
    header = (*_HEADER, *(_HEARD if measured else ()), "")
    table = Table(header, right=frozenset({2, 3, 5, 6, 7, 8, 9} if measured else {2, 3, 5, 6, 7}), shrink=4)
    for row in _rows(result, measured):
        table.add(*(row if measured or width >= _BARRED else row[:8]))
    return table


def _narrow_table(result: NetworkLoad, measured: Measured) -> Table:
    """The same without lengths, deadlines and bars."""
    table = Table((*_HEADER[:3], *_HEADER[4:7], *_HEARD), right=frozenset({2, 4, 5, 6, 7}), shrink=3)
    for cells in _rows(result, measured):
        table.add(*cells[:3], *cells[4:7], *cells[8:10])
    return table


def _rows(result: NetworkLoad, measured: Measured | None) -> Iterator[list[str | Cell]]:
    shares = [need.share for load in result.frames for need in load.needs if need.share is not None]
    most = max([*map(float, shares), *_measured_shares(result)], default=0.0)
    for frame in result.frames:
        for number, need in enumerate(frame.needs or (None,)):
            yield list(
                _row(result, frame, need, most, measured if number == 0 else None, received=measured is not None)
            )


def _measured_shares(result: NetworkLoad) -> Iterator[float]:
    for frame in result.frames:
        if result.measured is not None and frame.heard is not None:
            yield result.measured.share(frame.identifier, result.need.bit_rate)


def _row(
    result: NetworkLoad,
    one: FrameLoad,
    need: StreamLoad | None,
    most: float,
    measured: Measured | None,
    *,
    received: bool,
) -> Iterator[str | Cell]:
    can_id, extended = one.identifier
    yield can_id_text(can_id, extended=extended)
    yield one.label if need is None else need.stream.label
    yield "-" if one.node is None else str(one.node)
    share = 0.0
    if need is None:
        yield from (str(one.heard.data_bytes if one.heard else 0), "not computed", "-", "-", "-")
    else:
        share = 0.0 if need.share is None else float(need.share)
        yield from (_shorter(cell) if received else cell for cell in _need(need))
    if received:
        rate, load = "-", "-"
        if measured is not None and one.heard is not None:
            found = measured.share(one.identifier, result.need.bit_rate)
            share = max(share, found) if need is None else share
            rate, load = f"{measured.rate_hz(one.identifier):.1f}", _percent(found)
        style = "red" if one in result.too_often else ""
        yield Cell(rate, style)
        yield Cell(load, style)
    width = _NARROW if received else _BAR
    is_unknown = need is not None and need.share is None
    yield Cell("█" * (width - 1) + "▸", "red") if is_unknown else Cell(_bar(share, most, width), "cyan")


def _shorter(cell: str | Cell) -> str | Cell:
    """Abbreviate `inhibit 10.0 ms` for narrow screens."""
    if isinstance(cell, Cell):
        return Cell(cell.text.replace("inhibit ", "inh. "), cell.style)
    return cell.replace("inhibit ", "inh. ")


def _need(need: StreamLoad) -> Iterator[str | Cell]:
    stream = need.stream
    yield str(stream.frame.data_bytes)
    yield Cell(stream.why, "red") if need.share is None else stream.why
    yield Cell("no limit", "red") if need.share is None else _percent(need.share)
    late = "red" if need.is_late else ""
    yield Cell("no bound" if need.response_us is None else _ms(need.response_us), late)
    yield Cell("-" if stream.deadline_us is None else _ms(stream.deadline_us), late)


def _bar(share: float, most: float, width: int) -> str:
    return "█" * max(1, round(width * share / most)) if share and most else ""


def _sums(result: NetworkLoad, measured: Measured | None) -> Iterator[Line]:
    need = result.need
    if need.unlimited:
        yield [
            Cell("load  ", "bold"),
            Cell("unbounded", "red"),
            Cell(f"; all other frames: {_percent(need.limited)} at worst"),
        ]
        yield from _unlimited(need.unlimited)
    else:
        yield [
            Cell(f"load  {_percent(need.limited)} at worst", "red" if need.limited > 1 else "bold"),
            Cell(f", {_percent(need.least)} without stuff bits", "dim"),
        ]
    if measured is not None:
        found = f"measured {_percent(measured.load(need.bit_rate))}"
        expected = result.expected
        rates = f", computed for the same frames {_percent(expected)}" if expected is not None else ""
        yield f"      {found}{rates}{_not_whole(measured)}"
    yield from _too_often(result, measured)
    yield from _in_time(result)


def _too_often(result: NetworkLoad, measured: Measured | None) -> Iterator[Line]:
    """Show frames received more often than the assumed worst case, which is then too low."""
    if measured is None:
        return
    for load in result.too_often:
        rates = [1_000_000 / float(need.stream.frame.period_us) for need in load.needs if need.stream.frame.period_us]
        said = f"{_who(load.node, load.label)} was received {measured.rate_hz(load.identifier):.1f} times a second"
        yield [Cell("too often  ", "bold"), Cell(f"{said}, {sum(rates):.1f} are computed at worst", "red")]
    if result.too_often:
        how = f"dvtcli diff {result.file} names the differences" if result.file else "dvtcli check --live"
        yield [Cell("      hint: ", "cyan"), Cell(f"{how}; or two nodes have the same node-ID")]


def _unlimited(streams: Iterable[Stream]) -> Iterator[Line]:
    """Show unbounded frames by reason, and the remedy."""
    for names, text, hint in unbounded(streams):
        yield f"      {names}: {text}"
        yield [Cell("      hint: ", "cyan"), Cell(hint)]


def unbounded(streams: Iterable[Stream]) -> Iterator[tuple[str, str, str]]:
    """Group unbounded *streams*: names, reason, and remedy."""
    streams = list(streams)
    for why, text, hint in (
        (
            NO_LIMIT,
            "event-driven, without inhibit time and event timer",
            "--inhibit NODE:tpdoN=MS tries an inhibit time",
        ),
        (NO_SYNC, "synchronous, but no known node produces SYNC", "--sync MS sets its period"),
        (
            UNKNOWN_TYPE,
            "the transmission type is not known",
            "transmission: of the PDO in the network file says it; without a file, load asks the nodes",
        ),
        ("", "the transmission type is reserved", "a transmission type that CiA 301 has"),
    ):
        names = [
            _who(stream.node, stream.label)
            for stream in streams
            if (stream.why if stream.why in (NO_LIMIT, NO_SYNC, UNKNOWN_TYPE) else "") == why
        ]
        if names:
            yield join_some(names), text, hint


def _not_whole(measured: Measured) -> str:
    odd = [plural(number, what) for number, what in ((measured.error_frames, "error frame"),) if number]
    odd += [f"{measured.lost_frames} frames were lost here"] if measured.lost_frames else []
    return "".join(f"; {remark}" for remark in odd)


def _in_time(result: NetworkLoad) -> Iterator[Line]:
    late = [need for need in result.need.late if need.response_us is not None or not result.need.unlimited]
    if late:
        names = join_some(_who(need.stream.node, need.stream.label) for need in late)
        yield [Cell("late  ", "bold"), Cell(f"{names} may miss the deadline", "red")]
    elif result.need.fits:
        yield "every frame meets its deadline in the worst case"
    if result.fitting:
        yield "all of it fits at " + ", ".join(str(rate // 1000) for rate in result.fitting) + " kbit/s"
    elif not result.need.unlimited:
        yield "it does not fit at any bit rate of CiA 301"


def _who(node: int | None, label: str) -> str:
    return label if node is None else f"{node}:{label.lower()}" if "PDO" in label else f"{label} of node {node}"


def _percent(share: Fraction | float) -> str:
    return f"{100 * float(share):.2f} %"


def _ms(time_us: Fraction | int) -> str:
    value = float(time_us) / 1000
    return f"{value:.2f} ms" if value < 100 else f"{value:.0f} ms"

"""The text of every result, found by the result's type."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from dvtcli import results
from dvtcli.domain.nmt import NmtState
from dvtcli.view.changes import change_lines, compared_lines, stored_lines
from dvtcli.view.errors import finding_line
from dvtcli.view.lines import Cell, Line, Table
from dvtcli.view.pdos import listing_lines

_STATE_STYLES = {
    NmtState.OPERATIONAL.label: "green",
    NmtState.PRE_OPERATIONAL.label: "yellow",
    NmtState.STOPPED.label: "red",
}
_SEVERITY_STYLES = {"error": "red", "warning": "yellow", "note": "cyan"}


def text(result: Any, width: int) -> Iterable[Line]:
    """The lines of *result* for a screen of *width* columns."""
    return _RENDERERS[type(result)](result, width)


def remarks(result: Any) -> Iterator[Line]:
    """Warnings and notes that belong to *result*; they go to stderr."""
    if isinstance(result, (results.Changed, results.Facts)):
        yield from map(finding_line, result.findings)
    if isinstance(result, results.Commanded) and result.lost:
        yield [Cell("warning: ", "yellow"), Cell(f"the reset lost what was not stored: {', '.join(result.lost)}")]


def _value(result: results.ValueRead, _width: int) -> Iterator[Line]:
    number = result.value
    shown = repr(number) if isinstance(number, str) else str(number)
    if isinstance(number, bytes):
        shown = number.hex(" ").upper()
    elif isinstance(number, int) and not isinstance(number, bool):
        size = 2 * max(1, len(result.raw))
        shown = f"{number}  (0x{number & ((1 << 4 * size) - 1):0{size}X})"
    unit = f" {result.unit}" if result.unit else ""
    verb = " <- " if result.written else " = "
    name = f"  {result.name}" if result.name else ""
    yield [
        Cell(f"0x{result.object}"),
        Cell(name, "bold"),
        Cell(f"{verb}{shown}{unit}"),
        Cell(f"  {result.type_name}", "dim"),
    ]


def _objects(result: results.ObjectListing, width: int) -> Iterator[Line]:
    table = Table(("OBJECT", "NAME", "TYPE", "ACCESS", "MAPPABLE", "DEFAULT"), shrink=1)
    for row in result.rows:
        table.add(row.object, Cell(row.name, "bold"), row.type_name, row.access, row.mappable, row.default)
    yield from table.lines(width)
    yield f"{len(result.rows)} of {result.total} objects of {result.source}"


def _nodes(result: results.NodeListing, width: int) -> Iterator[Line]:
    if result.detail and result.rows:
        yield from _node_detail(result.rows[0])
        return
    table = Table(("NODE", "STATE", "DEVICE TYPE", "VENDOR", "PRODUCT", "NAME", "PROFILE"), frozenset({0}), shrink=5)
    for row in result.rows:
        table.add(
            str(row.node), Cell(row.state, _STATE_STYLES.get(row.state, "")), _word(row.device_type),
            _word(row.vendor_id), _word(row.product_code), row.name or row.note or "-", row.profile or "-",
        )  # fmt: skip
    if result.rows:
        yield from table.lines(width)
    count = len(result.rows)
    what = f"{count} node{'' if count == 1 else 's'} on {result.bus}, {result.seconds:.1f} s."
    yield what + (
        f" Select one: node {result.rows[0].node}" if result.rows else " Is the bit rate right? Is the bus powered?"
    )


def _word(value: int | None) -> str:
    return "-" if value is None else f"0x{value:08X}"


def _node_detail(row: results.NodeRow) -> Iterator[Line]:
    yield [
        Cell(f"node {row.node}", "bold"),
        Cell(f"  {row.name}"),
        Cell(f"  {row.state}", _STATE_STYLES.get(row.state, "")),
    ]
    facts = (
        ("device type", _word(row.device_type)), ("vendor", _word(row.vendor_id)),
        ("product", _word(row.product_code)), ("revision", _word(row.revision)), ("serial", _word(row.serial)),
        ("profile", row.profile), ("EDS", row.source or "none: --eds FILE names its objects"), ("note", row.note),
    )  # fmt: skip
    for label, value in facts:
        if value:
            yield [Cell(f"  {label:<12}", "dim"), Cell(value)]


def _commanded(result: results.Commanded, _width: int) -> Iterator[Line]:
    who = "all nodes" if result.node == 0 else f"node {result.node}"
    dry = " (dry run: nothing was sent)" if result.dry_run else ""
    state = result.state or "state not confirmed (no heartbeat)"
    yield [Cell(f"NMT {result.command} to {who}: "), Cell(state, _STATE_STYLES.get(state, "")), Cell(dry, "cyan")]


def _synced(result: results.Synced, width: int) -> Iterator[Line]:
    dry = " (dry run: nothing was sent)" if result.dry_run else ""
    came = sum(count for _, count, _ in result.frames)
    yield f"{plural(result.count, 'SYNC')} sent{dry}, {plural(came, 'frame')} came"
    table = Table(("COB-ID", "WHAT", "FRAMES", "LAST DATA"), frozenset({2}))
    for frame, count, label in result.frames:
        table.add(f"0x{frame.can_id:03X}", label or "-", str(count), frame.data.hex(" ").upper())
    if result.frames:
        yield from table.lines(width)


def plural(count: int, noun: str) -> str:
    """A number with its noun."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def _file(result: results.FileReport, _width: int) -> Iterator[Line]:
    for finding in result.findings:
        style = _SEVERITY_STYLES.get(finding.severity, "")
        yield [Cell(f"{result.path}:{finding.line}: "), Cell(f"{finding.severity}: ", style), Cell(finding.text)]
    yield (
        f"{result.path}: {result.sections} sections, {result.understood} understood, "
        f"{len(result.findings)} finding{'' if len(result.findings) == 1 else 's'}, {result.objects} objects"
    )


def _facts(result: results.Facts, _width: int) -> Iterable[Line]:
    return result.text


_RENDERERS: dict[type, Callable[[Any, int], Iterable[Line]]] = {
    results.PdoListing: listing_lines,
    results.ValueRead: _value,
    results.Changed: change_lines,
    results.Stored: stored_lines,
    results.Compared: compared_lines,
    results.ObjectListing: _objects,
    results.NodeListing: _nodes,
    results.Commanded: _commanded,
    results.Synced: _synced,
    results.FileReport: _file,
    results.Facts: _facts,
}

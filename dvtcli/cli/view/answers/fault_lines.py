"""The text of faults and EMCY messages."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from dvtcli.cli.view.lines import Cell, Line, Table, part
from dvtcli.domain.emergency_codes import register_words
from dvtcli.domain.times import local_clock
from dvtcli.operations.results.node_errors import FaultRow, Faults, FaultSeen

_SOURCES = {"active": "active now", "history": "history", "heard": "EMCY heard"}


def fault_lines(result: Faults, width: int) -> Iterator[Line]:
    """Show a node's errors with remedies, and its error register."""
    yield from _remembered(result)
    if result.rows:
        table = Table(("WHERE", "CODE", "MEANING", "COUNT", "LAST", "MORE"), frozenset({3}), shrink=2)
        for row in result.rows:
            count = "" if row.count is None else str(row.count)
            table.add(_SOURCES[row.source], f"0x{row.code:04X}", Cell(row.text, "bold"), count, _at(row), _more(row))
        yield from table.lines(width)
        yield from _remedies(result.rows)
    yield _register(result)


def _remembered(result: Faults) -> Iterator[Line]:
    who = f"node {result.node} ({result.name})"
    if result.cleared:
        what = f"held {len(result.rows)}" if result.rows else "was empty already"
        end = " on its twin; the node's own was not touched" if result.dry_run else ", read back"
        yield f"{who}: the error history {what}, and is empty now{end}"
    elif result.rows:
        yield f"{who}: errors, newest first"
    else:
        yield f"{who}: no error is reported, no EMCY was received"
    if not result.has_history:
        yield "it has no error history (0x1003)"


def _register(result: Faults) -> Line:
    if result.register is None:
        return "it has no error register (0x1001)"
    words = ", ".join(result.register_words) or "no error now"
    still = ": still wrong, an empty history mends nothing" if result.cleared and result.register else ""
    return [
        Cell(f"error register 0x{result.register:02X}: "),
        Cell(words, "bold" if result.register else ""),
        Cell(still),
    ]


def _remedies(rows: Iterable[FaultRow]) -> Iterator[Line]:
    """Show the remedy once per error code."""
    for code, remedy in {row.code: row.remedy for row in rows if row.remedy}.items():
        yield [Cell(f"  0x{code:04X}: ", "dim"), part(remedy)]


def _at(row: FaultRow) -> str:
    return "" if row.last_s is None else local_clock(row.last_s, "milliseconds")


def _more(row: FaultRow) -> str:
    """Return the manufacturer's bytes unless 0."""
    if row.information:
        return f"0x{row.information:04X}"
    return row.manufacturer.hex(" ").upper() if row.manufacturer and any(row.manufacturer) else ""


def fault_seen_lines(result: FaultSeen, _width: int) -> Iterator[Line]:
    """Show an EMCY message with local time and meaning, and with the remedy on first occurrence."""
    fault = result.fault
    register = ", ".join(register_words(fault.register or 0)) or "no error now"
    more = _more(fault)
    yield [
        Cell(f"{_at(fault)}  ", "dim"),
        Cell(f"node {result.node:<3}  0x{fault.code:04X}  "),
        Cell(fault.text, "bold"),
        Cell(f"  register 0x{fault.register or 0:02X}: {register}"),
        Cell(f"  {more}" if more else ""),
        Cell(f"  ({fault.count} times)" if (fault.count or 0) > 1 else "", "dim"),
    ]
    if fault.remedy and fault.count == 1:
        yield [Cell(" " * 14), part(fault.remedy)]

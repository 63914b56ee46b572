"""The text of what is remembered of devices."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.several import join_some
from dvtcli.operations.results.habit_listing import HabitListing, Wanted


def habit_lines(result: HabitListing, width: int) -> Iterator[Line]:
    """What was forgotten, then a line for each thing that a device takes only if a PDO, or the node, is in a state."""
    if result.forgotten:
        yield f"forgotten: what {join_some(result.forgotten)} was found to want"
    if not result.rows:
        yield "nothing is remembered of any device"
        return
    table = Table(("VENDOR-PRODUCT-REVISION", "REFUSED", "TIMES", "SO"), shrink=1)
    for row in result.rows:
        for wanted in row.wanted:
            so = "disabled first" if wanted.counts else "tried first"
            table.add(Cell(row.name, "bold"), _refused(wanted), str(wanted.times), so)
        for state in row.pre_operational:
            so = "PRE-OPERATIONAL first" if state.counts else "tried first"
            refused = f"PDO writes while it is OPERATIONAL, 0x{state.abort:08X}"
            table.add(Cell(row.name, "bold"), refused, str(state.times), so)
        if row.problem:
            table.add(Cell(row.name, "bold"), Cell(row.problem, "yellow"), "", "tried first")
    yield from table.lines(width)
    yield [Cell(f"kept in {result.folder}; profiles forget NAME forgets it", "dim")]


def _refused(wanted: Wanted) -> str:
    """The parameter by its place, and the refusal."""
    base = "0x1800" if wanted.direction == "tpdo" else "0x1400"
    return f"{base}:{wanted.sub_index:02X} and alike while the PDO is on, 0x{wanted.abort:08X}"

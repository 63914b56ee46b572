"""The text of virtual PDOs."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.operations.results.vpdos import VpdoListing


def vpdo_lines(result: VpdoListing, width: int) -> Iterator[Line]:
    """A line for each active pin, and one for a group that has none."""
    if result.said:
        yield result.said
    table = Table(("GROUP", "PIN", "OBJECT", "NAME"), frozenset({1}), 3)
    for group in result.groups:
        label = Cell(group.name, "bold")
        for row in group.rows:
            tied = "none" if row.index is None else f"0x{row.index:04X}"
            table.add(label, f"{row.pin}", Cell(tied, "dim" if row.index is None else ""), row.name)
            label = Cell("")
        if not group.rows:
            table.add(label, "-", Cell("none", "dim"), "")
    yield from table.lines(width)
    free = ", ".join(f"{group.name} {len(group.rows)} of {group.pins}" for group in result.groups)
    yield [Cell(f"active pins: {free}", "dim")]

"""The text of device profiles."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.operations.results.device_profiles import ProfileListing, ProfileRow, ProfileShown


def profile_list_lines(result: ProfileListing, width: int) -> Iterator[Line]:
    """A line for each profile, and where to put one's own."""
    table = Table(("PROFILE", "DEVICES", "VENDOR", "FROM"), shrink=3)
    for row in result.rows:
        table.add(Cell(row.name, "bold"), row.title, _vendors(row), row.file if row.own else "dvtcli")
    yield from table.lines(width)
    yield [Cell(f"your own: {result.folder}", "dim")]


def profile_lines(result: ProfileShown, _width: int) -> Iterator[Line]:
    """Every value with the reason for it; nothing is cut off, since a reason is what is asked for."""
    yield [Cell(result.row.name, "bold"), Cell(f"  {result.row.title}  {_vendors(result.row)}".rstrip())]
    key_width = max(len(key) for key, _, _ in result.values)
    value_width = min(40, max(len(value) for _, value, _ in result.values))
    for key, value, reason in result.values:
        yield [Cell(f"  {key:<{key_width}}  "), Cell(f"{value:<{value_width}}"), Cell(f"  {reason}", "dim")]
    rest = f"as {result.like} (profiles show {result.like})" if result.like else "as the EDS says, else CiA 301"
    yield f"everything else is {rest}"


def _vendors(row: ProfileRow) -> str:
    return ", ".join(f"0x{vendor:X}" for vendor in row.vendor_ids) or "any"

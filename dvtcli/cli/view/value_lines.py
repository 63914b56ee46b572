"""The text of values and dictionary entries."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.drive_state import STATUSWORD, drive_state
from dvtcli.operations.results.values import ObjectListing, ValueRead

#: how many bytes of a long value are shown
MOST_SHOWN = 128


def value_lines(result: ValueRead, _width: int) -> Iterator[Line]:
    """An object with its value, decoded and raw."""
    number = result.value
    shown = repr(number) if isinstance(number, str) else str(number)
    if isinstance(number, bytes):
        shown = cut_bytes(number)
    elif isinstance(number, int) and not isinstance(number, bool):
        size = 2 * max(1, len(result.raw))
        shown = f"{number}  (0x{number & ((1 << 4 * size) - 1):0{size}X})"
        if result.object == STATUSWORD:
            shown = f"{shown}  {drive_state(number)}".rstrip()
    unit = f" {result.unit}" if result.unit else ""
    verb = " <- " if result.written else " = "
    name = f"  {result.name}" if result.name else ""
    yield [
        Cell(f"0x{result.object}"),
        Cell(name, "bold"),
        Cell(f"{verb}{shown}{unit}"),
        Cell(f"  {result.type_name}", "dim"),
    ]


def cut_bytes(data: bytes) -> str:
    """The first of many bytes, and how many there are."""
    if len(data) <= MOST_SHOWN:
        return data.hex(" ").upper()
    return f"{data[:MOST_SHOWN].hex(' ').upper()} … {len(data):,} bytes"


def object_lines(result: ObjectListing, width: int) -> Iterator[Line]:
    """Entries of the object dictionary."""
    table = Table(("OBJECT", "NAME", "TYPE", "ACCESS", "MAPPABLE", "DEFAULT"), shrink=1)
    for row in result.rows:
        table.add(row.object, Cell(row.name, "bold"), row.type_name, row.access, row.mappable, row.default)
    yield from table.lines(width)
    yield f"{len(result.rows)} of {result.total} objects of {result.source}"

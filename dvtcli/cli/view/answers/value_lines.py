"""The text of values and dictionary entries."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.shown_value import MOST_SHOWN, value_text
from dvtcli.operations.results.values import ObjectListing, ValueRead


def value_lines(result: ValueRead, _width: int) -> Iterator[Line]:
    """An object with its value; of a drive's word also the names of the bits that are set."""
    yield [*value_line(result), *_into_file(result)]
    number, meaning = result.value, result.meaning
    if meaning.states and isinstance(number, int) and (bits := meaning.set_bits(number)):
        yield [Cell(f"  {', '.join(bits)}", "dim")]


def value_line(result: ValueRead) -> list[Cell]:
    """An object with its value, decoded and raw."""
    number = result.value
    if isinstance(number, str):
        shown = repr(number)
    else:
        shown = value_text(number, result.meaning, 8 * max(1, len(result.raw)), hexed=True)
    verb = " <- " if result.written else " = "
    name = f"  {result.name}" if result.name else ""
    return [
        Cell(f"0x{result.object}"),
        Cell(name, "bold"),
        Cell(f"{verb}{shown}"),
        Cell(f"  {result.type_name}", "dim"),
    ]


def _into_file(result: ValueRead) -> Iterator[Cell | Hint]:
    """What gives the whole of a value that is shown in part."""
    if isinstance(result.value, bytes) and len(result.value) > MOST_SHOWN and not result.written:
        yield from (Cell("; "), Hint(Action.READ, {"object": result.object, "into": "FILE"}, "has all"))


def object_lines(result: ObjectListing, width: int) -> Iterator[Line]:
    """Entries of the object dictionary."""
    table = Table(("OBJECT", "NAME", "TYPE", "ACCESS", "MAPPABLE", "DEFAULT"), shrink=1)
    for row in result.rows:
        table.add(row.object, Cell(row.name, "bold"), row.type_name, row.access, row.mappable, row.default)
    yield from table.lines(width)
    yield f"{len(result.rows)} of {result.total} objects of {result.source}"

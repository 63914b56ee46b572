"""The text of several objects' values and their trend."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_scalings import MOST_SHOWN, value_text
from dvtcli.operations.results.values import EntryUnread, ObjectListing, RecordRead, ValueRead

if TYPE_CHECKING:
    from dvtcli.operations.results.values import ValuesRead, ValuesWatched


def value_lines(result: ValueRead, _width: int) -> Iterator[Line]:
    """Show an object with its value; for a drive's statusword also the names of set bits."""
    yield [*value_line(result), *_into_file(result)]
    number, meaning = result.value, result.meaning
    if meaning.states and isinstance(number, int) and (bits := meaning.set_bits(number)):
        yield [Cell(f"  {', '.join(bits)}", "dim")]


def value_line(result: ValueRead) -> list[Cell]:
    """Show an object with its value, decoded and raw."""
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
    """Show the command for the whole of a value shown in part."""
    if isinstance(result.value, bytes) and len(result.value) > MOST_SHOWN and not result.written:
        yield from (Cell("; "), Hint(Action.READ, {"object": result.object, "into": "FILE"}, "has all"))


def object_lines(result: ObjectListing, width: int) -> Iterator[Line]:
    """Show entries of the object dictionary."""
    table = Table(("OBJECT", "NAME", "TYPE", "ACCESS", "MAPPABLE", "DEFAULT"), shrink=1)
    for row in result.rows:
        table.add(row.object, Cell(row.name, "bold"), row.type_name, row.access, row.mappable, row.default)
    yield from table.lines(width)
    yield f"{len(result.rows)} of {result.total} objects of {result.source}"


def record_lines(result: RecordRead, _width: int) -> Iterator[Line]:
    """Sub-index 0, and each entry, as each for itself."""
    yield value_line(result.head)
    for entry in result.entries:
        if isinstance(entry, EntryUnread):
            abort = "" if entry.abort is None else f"0x{entry.abort:08X} "
            name = f"  {entry.name}" if entry.name else ""
            line: list[Cell | Hint] = [Cell(f"0x{entry.object}"), Cell(name, "bold")]
            line.append(Cell(f"  not read: {abort}{entry.text}", "yellow"))
            if entry.abort is None:
                line += [Cell("; "), Hint(Action.READ, {"object": entry.object, "into": "FILE"}, "does")]
            yield line
        else:
            yield value_line(entry)


_LEVELS = "▁▂▃▄▅▆▇█"


def values_lines(result: ValuesRead, width: int) -> Iterator[Line]:
    """Show an object per line, or all on a line with its time."""
    if result.at_s is not None:
        values = [value for value in result.values if isinstance(value, ValueRead)]
        yield [
            Cell(f"{result.at_s:9.3f} s", "dim"),
            *(Cell(f"  {_place(value)} {_value(value)}") for value in values),
        ]
        return
    several_nodes = len({value.node for value in result.values}) > 1
    for value in result.values:
        for line in record_lines(value, width) if isinstance(value, RecordRead) else [value_line(value)]:
            assert isinstance(line, list)  # noqa: S101 - it is one of cells
            yield [Cell(f"node {value.node}  "), *line] if several_nodes else line


def watched_lines(result: ValuesWatched, width: int) -> Iterator[Line]:
    """Show minimum, maximum and last value of each object, and a graph of the last values."""
    from dvtcli.watch.statistics import spark

    header = ("NODE", "OBJECT", "NAME", "READ", "MIN", "MAX", "LAST", "TREND")
    table = Table(header, right=frozenset({3, 4, 5, 6}), shrink=2)
    for course in result.courses:
        last = course.last
        if last is not None:
            least, most = (_number(number, last) for number in (course.least, course.most))
            drawn = Cell(spark(list(course.points), _LEVELS), "green")
            table.add(str(last.node), last.object, last.name, f"{course.samples}x", least, most, _value(last), drawn)
    yield from table.lines(width)
    if result.file is not None:
        yield f"{result.file}: {result.courses[0].samples} rows"


def _place(one: ValueRead) -> str:
    return f"{one.node}:{one.object}"


def _number(number: float | None, last: ValueRead) -> str:
    """Least and most: a unit, but no raw value."""
    return "-" if number is None else last.meaning.quantity(number) if last.meaning.has_number else f"{number:g}"


def _value(one: ValueRead) -> str:
    return value_text(one.value, one.meaning, 8 * len(one.raw))

"""The text of several objects' values, and of the course they took."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.answers.record_lines import record_lines
from dvtcli.cli.view.answers.value_lines import value_line
from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.shown_value import value_text
from dvtcli.operations.results.records import RecordRead
from dvtcli.operations.results.values import ValueRead
from dvtcli.watch.statistics import spark

if TYPE_CHECKING:
    from dvtcli.operations.results.watched_values import ValuesRead, ValuesWatched

_LEVELS = "▁▂▃▄▅▆▇█"


def values_lines(result: ValuesRead, width: int) -> Iterator[Line]:
    """One object a line, or all of them in a line with its time."""
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
    """Least, most and last of each object, and its last values as a picture."""
    header = ("NODE", "OBJECT", "NAME", "READ", "LEAST", "MOST", "LAST", "COURSE")
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

"""Find the text renderer declared by a result's class; imports only its module."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Cell, Line, part
from dvtcli.domain.text import join_some

if TYPE_CHECKING:
    from dvtcli.operations.results import Result


def text(result: Result, width: int, format_name: str = "text") -> Iterable[Line]:
    """Return the lines of *result* for *width* columns, or in another format of its class."""
    return renderer_of(result, format_name)(result, width)


def renderer_of(result: Result, format_name: str = "text") -> Callable[[Result, int], Iterable[Line]]:
    """Return what makes the lines of results of the class of *result*, in a format."""
    report = result.formats.get(format_name)
    return _renderer(report or result.renderer, is_report=bool(report))


@cache
def _renderer(place: str, *, is_report: bool) -> Callable[[Result, int], Iterable[Line]]:
    """Return the function named by *place*: `pdo_lines:listing_lines`, of a report `junit_lines`."""
    module, _, function = place.rpartition(":")
    if is_report:
        from dvtcli.cli.view import reports as written
    else:
        written = import_module(f"dvtcli.cli.view.answers.{module}")
    lines: Callable[[Result, int], Iterable[Line]] = getattr(written, function)
    return lines


def remarks(result: Result) -> Iterator[Line]:
    """Return warnings and notes of *result* for stderr."""
    findings = getattr(result, "findings", ())
    if findings and result.show_findings:
        from dvtcli.cli.view.error_lines import finding_lines

        yield from finding_lines(findings)
    lost = getattr(result, "lost", ())
    if lost:
        yield [Cell("warning: ", "yellow"), Cell(f"the reset lost unstored values: {join_some(lost)}")]
    for number, reason in enumerate(getattr(result, "reasons", ())):
        yield [Cell("      " if number else "why:  ", "yellow"), part(reason)]
    if result.remark:
        yield result.remark

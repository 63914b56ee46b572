"""The text of files and plain facts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from dvtcli.cli.view.lines import Cell, Line
from dvtcli.operations.results.dvt import DvtAnswer
from dvtcli.operations.results.files import Facts, FileReport

_SEVERITY_STYLES = {"error": "red", "warning": "yellow", "note": "cyan"}


def file_lines(result: FileReport, _width: int) -> Iterator[Line]:
    """Findings of a file with their lines, and the sum."""
    for finding in result.findings:
        style = _SEVERITY_STYLES.get(finding.severity, "")
        yield [Cell(f"{result.path}:{finding.line}: "), Cell(f"{finding.severity}: ", style), Cell(finding.text)]
    yield (
        f"{result.path}: {result.sections} sections, {result.understood} understood, "
        f"{len(result.findings)} finding{'' if len(result.findings) == 1 else 's'}, {result.objects} objects"
    )


def fact_lines(result: Facts, _width: int) -> Iterable[Line]:
    """The lines as they are."""
    return result.text


def answer_lines(result: DvtAnswer, _width: int) -> Iterable[Line]:
    """The word's answer alone, as the DVT prints it."""
    return (result.answer,)

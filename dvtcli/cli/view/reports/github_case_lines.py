"""Comparisons and failures as workflow commands of GitHub Actions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Line
from dvtcli.cli.view.reports.cases import cases_of
from dvtcli.cli.view.reports.github_lines import as_data, as_property
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.domain.text import plural
from dvtcli.errors import InputFileError, RuleError

if TYPE_CHECKING:
    from dvtcli.errors import DvtcliError
    from dvtcli.operations.results import Compared, ComparedNodes, NetworkPlanned, WholeCompared

_LEVELS = {"error": "error", "warning": "warning", "notice": "notice", "skipped": "notice"}


def github_case_lines(result: NetworkPlanned | Compared | ComparedNodes | WholeCompared, _width: int) -> Iterator[Line]:
    """Show a command per difference, errors first, and the sum: GitHub shows ten of a kind."""
    cases = list(cases_of(result))
    for level, command in _LEVELS.items():
        for case in cases:
            if case.says and case.level == level:
                text = f"{case.name} of {case.where}: {'; '.join(case.says)}"
                yield workflow_command(command, case.file, case.line, case.where, text, case.column)
    differing = sum(bool(case.says) for case in cases)
    yield f"{plural(len(cases), 'case')}, {plural(differing, 'notice')} or worse"


def github_error_lines(error: DvtcliError) -> Iterator[Line]:
    """Show a command per complaint about a file, else for the failure, and for related failures."""
    complaints = error.complaints if isinstance(error, InputFileError | RuleError) else ()
    for complaint in complaints:
        yield workflow_command("error", complaint.file, complaint.line, "dvtcli", complaint.text, complaint.column)
    if not complaints:
        yield workflow_command("error", "", 0, error.slug, error_text(error, str(error)))
    for label, text in error.details:
        if label == "also":
            yield workflow_command("error", "", 0, error.slug, text)


def workflow_command(level: str, file: str, line: int, title: str, text: str, column: int = 0) -> str:
    """Return a workflow command of *level* for a place, with possibly empty parts."""
    places = (("file", file), ("line", line), ("col", column), ("title", title))
    words = ",".join(f"{key}={as_property(str(value))}" for key, value in places if value)
    return f"::{level} {words}::{as_data(text)}"

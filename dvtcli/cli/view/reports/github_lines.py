"""The workflow commands by which GitHub Actions shows findings, and failed lines of a script, beside a file's lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Line
from dvtcli.cli.view.reports.cases import cases_of, why_failed
from dvtcli.cli.view.typed_hints import advised, error_text
from dvtcli.domain.text import plural, safe
from dvtcli.errors import InputFileError, RuleError
from dvtcli.operations.results.checked_files import SEVERITIES, Reported

if TYPE_CHECKING:
    from dvtcli.cli.view.reports.cases import LineRan
    from dvtcli.errors import DvtcliError
    from dvtcli.operations.results import Compared, ComparedNodes, NetworkPlanned, WholeCompared

#: the command for each severity, and for each level of a case, worst first
_COMMANDS = {"error": "error", "warning": "warning", "note": "notice", "notice": "notice", "skipped": "notice"}


def github_lines(result: Reported, _width: int) -> Iterator[Line]:
    """Show a command per finding, errors first, and each file's sum: GitHub shows ten of a kind and step."""
    reports = result.reports
    for severity in SEVERITIES:
        for report in reports:
            for finding in report.findings:
                if finding.severity == severity:
                    yield workflow_command(
                        severity,
                        report.path,
                        finding.line,
                        finding.rule,
                        advised(finding),
                        finding.column,
                        finding.end_column,
                    )
    for report in reports:
        counted = report.count()
        found = ", ".join(plural(counted[severity], severity) for severity in SEVERITIES)
        yield line_without_command(f"{report.path}: {found}")


def escaped_message(text: str) -> str:
    """Escape *text* for the message of a workflow command."""
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def line_without_command(text: str) -> str:
    """Return *text*, beginning with a path, as a line that is no workflow command: `::x::`, `##[x]`."""
    plain = text.replace("##[", "## [")
    return f"./{plain}" if plain.lstrip().startswith("::") else plain


def escaped_property(text: str) -> str:
    """Escape *text* for a property of a workflow command."""
    return escaped_message(text).replace(":", "%3A").replace(",", "%2C")


def github_case_lines(result: NetworkPlanned | Compared | ComparedNodes | WholeCompared, _width: int) -> Iterator[Line]:
    """Show a command per difference, errors first, and the sum: GitHub shows ten of a kind."""
    cases = list(cases_of(result))
    for level in _COMMANDS:
        for case in cases:
            if case.differences and case.level == level:
                text = f"{case.name} of {case.where}: {'; '.join(case.differences)}"
                yield workflow_command(level, case.file, case.line, case.where, text, case.column)
    differing = sum(bool(case.differences) for case in cases)
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


def workflow_command(
    level: str, file: str, line: int, title: str, text: str, column: int = 0, end_column: int = 0
) -> str:
    """Return a workflow command of *level* for a place, with possibly empty parts."""
    places = (("file", file), ("line", line), ("col", column), ("endColumn", end_column), ("title", title))
    words = ",".join(f"{key}={escaped_property(str(value))}" for key, value in places if value)
    return f"::{_COMMANDS[level]} {words}::{escaped_message(text)}"


def github_script_lines(lines: Sequence[LineRan]) -> Iterator[Line]:
    """Show each line's output in a group, an error per failure, and the number of lines.

    A device's text must not begin a line: it could be a workflow command.
    """
    for line in lines:
        if line.said:
            yield f"::group::{escaped_message(safe(line.words))}"
            yield from (f"| {safe(text)}" for text in line.said.splitlines())
            yield "::endgroup::"
        if line.code:
            yield workflow_command("error", line.file, line.number, line.words.partition(" ")[0], why_failed(line))
    failed, missed = sum(bool(line.code) for line in lines), sum(line.code is None for line in lines)
    yield f"{plural(len(lines), 'line')}, {failed} failed, {missed} not reached"

"""The workflow commands by which GitHub Actions shows findings beside a file's lines."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Line
from dvtcli.domain.text import plural
from dvtcli.operations.results.checked_files import SEVERITIES, FileFinding, Report, Reported

_COMMANDS = {"error": "error", "warning": "warning", "note": "notice"}


def github_lines(result: Reported, _width: int) -> Iterator[Line]:
    """Show a command per finding, errors first, and each file's sum: GitHub shows ten of a kind and step."""
    reports = result.reports
    for severity in SEVERITIES:
        for report in reports:
            for finding in report.findings:
                if finding.severity == severity:
                    yield f"::{_COMMANDS[severity]} {_place(report, finding)}::{as_data(finding.text)}"
    for report in reports:
        counted = report.count()
        yield as_path(f"{report.path}: {', '.join(plural(counted[severity], severity) for severity in SEVERITIES)}")


def _place(report: Report, finding: FileFinding) -> str:
    columns = f"col={finding.column},endColumn={finding.end_column}," if finding.column else ""
    return f"file={as_property(report.path)},line={finding.line},{columns}title={as_property(finding.rule)}"


def as_data(text: str) -> str:
    """Escape *text* for the message of a workflow command."""
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def as_path(text: str) -> str:
    """Return *text*, beginning with a path, as a line that is no workflow command: `::x::`, `##[x]`."""
    plain = text.replace("##[", "## [")
    return f"./{plain}" if plain.lstrip().startswith("::") else plain


def as_property(text: str) -> str:
    """Escape *text* for a property of a workflow command."""
    return as_data(text).replace(":", "%3A").replace(",", "%2C")

"""The workflow commands by which GitHub Actions shows findings beside a file's lines."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Line
from dvtcli.domain.several import plural
from dvtcli.operations.results.checked_files import SEVERITIES, FileFinding, FileReport, FileReports, reports_of

_COMMANDS = {"error": "error", "warning": "warning", "note": "notice"}


def github_lines(result: FileReport | FileReports, _width: int) -> Iterator[Line]:
    """A command for each finding, errors first, and the sum of each file: GitHub shows ten of a kind and step."""
    reports = reports_of(result)
    for severity in SEVERITIES:
        for one in reports:
            for finding in one.findings:
                if finding.severity == severity:
                    yield f"::{_COMMANDS[severity]} {_place(one, finding)}::{_data(finding.text)}"
    for one in reports:
        counted = one.count()
        yield f"{one.path}: {', '.join(plural(counted[severity], severity) for severity in SEVERITIES)}"


def _place(report: FileReport, finding: FileFinding) -> str:
    columns = f"col={finding.column},endColumn={finding.end_column}," if finding.column else ""
    return f"file={_property(report.path)},line={finding.line},{columns}title={_property(finding.rule)}"


def _data(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")

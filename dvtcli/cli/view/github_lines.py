"""The workflow commands by which GitHub Actions shows findings beside a file's lines."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Line
from dvtcli.domain.several import plural
from dvtcli.operations.results.checked_files import SEVERITIES, FileReport

_COMMANDS = {"error": "error", "warning": "warning", "note": "notice"}


def github_lines(result: FileReport, _width: int) -> Iterator[Line]:
    """A command for each finding, errors first, and the sum: GitHub shows ten of a kind and step."""
    for severity in SEVERITIES:
        for finding in result.findings:
            if finding.severity == severity:
                place = f"file={_property(result.path)},line={finding.line},title={_property(finding.rule)}"
                yield f"::{_COMMANDS[severity]} {place}::{_data(finding.text)}"
    counted = result.count()
    yield f"{result.path}: {', '.join(plural(counted[severity], severity) for severity in SEVERITIES)}"


def _data(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")

"""The text of `eds check`: findings by line, then a count per rule."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.several import plural
from dvtcli.operations.results.checked_files import SEVERITIES, FileReport, FileReports

STYLES = {"error": "red", "warning": "yellow", "note": "cyan"}
#: Maximum number of findings per rule; `--rule` shows all, and other formats always have all.
_SHOWN = 10


def check_lines(result: FileReport, width: int) -> Iterator[Line]:
    """Show a file's findings with lines, a line for each rule with findings, and the sum."""
    times = Counter(finding.rule for finding in result.findings)
    most = len(result.findings) if len(result.rules) == 1 else _SHOWN
    said: Counter[str] = Counter()
    for finding in result.findings:
        said[finding.rule] += 1
        if said[finding.rule] > most:
            continue
        yield [
            Cell(f"{result.path}:{finding.line}: "),
            Cell(f"{finding.severity}: ", STYLES[finding.severity]),
            Cell(f"{finding.text} "),
            Cell(f"[{finding.rule}]", "dim"),
        ]
    yield from _summary(result, times, most, width)
    counted = result.count()
    found = ", ".join(plural(counted[severity], severity) for severity in SEVERITIES)
    yield (
        f"{result.path}: {result.sections} sections, {result.understood} understood, {result.objects} objects, "
        f"{plural(len(result.rules), 'rule')}: {found}"
    )


def checks_lines(result: FileReports, width: int) -> Iterator[Line]:
    """Show `check_lines` for each file, and the total."""
    for file in result.files:
        yield from check_lines(file, width)
    counted, bad = result.count(), sum(1 for report in result.files if report.exit_code)
    found = ", ".join(plural(counted[severity], severity) for severity in SEVERITIES)
    yield f"{plural(len(result.files), 'file')}, {bad} of them invalid: {found}"


def _summary(result: FileReport, times: Counter[str], most: int, width: int) -> Iterator[Line]:
    table = Table(right=frozenset({0}), shrink=3)
    for severity in SEVERITIES:
        for rule in sorted((rule for rule in result.rules if rule.severity == severity), key=lambda rule: rule.name):
            if times[rule.name]:
                more = f"{most} shown, --rule {rule.name} shows all: " if times[rule.name] > most else ""
                table.add(str(times[rule.name]), Cell(severity, STYLES[severity]), rule.name, f"{more}{rule.sense}")
    yield from table.lines(width)

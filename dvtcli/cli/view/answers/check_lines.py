"""The text of `eds check`, and of `check` for recordings: findings by line or frame, then the sum."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.text import join_some, plural
from dvtcli.operations.results.checked_files import SEVERITIES, FileFinding, FileReport, FileReports

if TYPE_CHECKING:
    from dvtcli.operations.results.checked_recordings import RecordingFinding, RecordingReport, RecordingsChecked

STYLES = {"error": "red", "warning": "yellow", "note": "cyan"}
#: Maximum number of causes per rule; `--rule` shows every finding, and other formats always have all.
_SHOWN = 10


def check_lines(result: FileReport, width: int) -> Iterator[Line]:
    """Show a file's findings with lines, a line for each rule with findings, and the sum."""
    times = Counter(finding.rule for finding in result.findings)
    is_alone = len(result.rules) == 1
    most = len(result.findings) if is_alone else _SHOWN
    causes = [[finding] for finding in result.findings] if is_alone else _by_cause(result.findings)
    said: Counter[str] = Counter()
    shown: Counter[str] = Counter()
    for finding, *others in causes:
        said[finding.rule] += 1
        if said[finding.rule] > most:
            continue
        shown[finding.rule] += 1 + len(others)
        more = f"({len(others) + 1} times: also line {join_some([str(one.line) for one in others])}) " if others else ""
        yield [
            Cell(f"{result.path}:{finding.line}: "),
            Cell(f"{finding.severity}: ", STYLES[finding.severity]),
            Cell(f"{finding.text} "),
            Cell(more, "dim"),
            Cell(f"[{finding.rule}]", "dim"),
        ]
    yield from _summary(result, times, shown, width)
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


def _by_cause(findings: Iterable[FileFinding]) -> list[list[FileFinding]]:
    """Put findings of a rule that say the same, whatever their objects, behind the first."""
    causes: dict[tuple[str, str], list[FileFinding]] = {}
    for finding in findings:
        about = finding.text.removeprefix(finding.object)
        causes.setdefault((finding.rule, about), []).append(finding)
    return list(causes.values())


def _summary(result: FileReport, times: Counter[str], shown: Counter[str], width: int) -> Iterator[Line]:
    table = Table(right=frozenset({0}), shrink=3)
    for severity in SEVERITIES:
        for rule in sorted((rule for rule in result.rules if rule.severity == severity), key=lambda rule: rule.name):
            if times[rule.name]:
                is_cut = times[rule.name] > shown[rule.name]
                more = f"{shown[rule.name]} shown, --rule {rule.name} shows all: " if is_cut else ""
                table.add(str(times[rule.name]), Cell(severity, STYLES[severity]), rule.name, f"{more}{rule.sense}")
    yield from table.lines(width)


def recording_lines(result: RecordingsChecked, _width: int) -> Iterator[Line]:
    """Show each recording's problems, the worst first, with times from its beginning, and its sum."""
    for report in result.reports:
        for finding in report.findings:
            yield from _finding(report, finding)
        if report.unread:
            continue
        counted = report.count()
        found = ", ".join(plural(counted[severity], severity) for severity in SEVERITIES if counted[severity])
        seconds = report.last_s - report.first_s
        yield f"{report.path}: {plural(report.frames, 'frame')} in {seconds:.1f} s; {found or 'no problem'}"


def _finding(report: RecordingReport, found: RecordingFinding) -> Iterator[Line]:
    line = f":{found.line}" if found.line > 1 or found.frames else ""
    yield [
        Cell(f"{report.path}{line}: "),
        Cell(f"{found.severity}: ", STYLES[found.severity]),
        Cell(f"{found.text} "),
        Cell(f"[{found.rule}]", "dim"),
    ]
    if not found.frames:
        return
    when = f"at {found.first_s - report.first_s:.3f} s"
    if found.times > 1:
        when = f"{found.times} times, {when} to {found.last_s - report.first_s:.3f} s"
    frames = ", ".join(map(str, found.frames)) + (", …" if found.times > len(found.frames) else "")
    bus = f" on {found.bus}" if found.bus else ""
    yield f"  {found.parties}{bus}, {when}; {'frame' if len(found.frames) == 1 else 'frames'} {frames}"
    yield f"  check first: {found.look}"

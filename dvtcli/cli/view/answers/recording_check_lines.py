"""The text of `check` for recordings: each problem with its time and frames, and the sum."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.answers.check_lines import STYLES
from dvtcli.cli.view.lines import Cell, Line
from dvtcli.domain.text import plural
from dvtcli.operations.results.checked_files import SEVERITIES

if TYPE_CHECKING:
    from dvtcli.operations.results.checked_recordings import RecordingFinding, RecordingReport, RecordingsChecked


def check_lines(result: RecordingsChecked, _width: int) -> Iterator[Line]:
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
    yield f"  look first: {found.look}"

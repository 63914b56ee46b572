"""The text of a network's check."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.answers.check_lines import STYLES
from dvtcli.cli.view.error_lines import source_lines
from dvtcli.cli.view.lines import Cell, Line
from dvtcli.domain.text import plural
from dvtcli.operations.results.checked_files import SEVERITIES

if TYPE_CHECKING:
    from dvtcli.operations.results.checked_networks import NetworkFinding, NetworkReport, NetworksChecked


def check_lines(result: NetworksChecked, _width: int) -> Iterator[Line]:
    """Findings with their places, the worst first, and a line for each file."""
    for report in result.reports:
        for line, column, times, text in report.notes:
            more = f" ({times} times)" if times > 1 else ""
            yield f"{report.path}:{line}:{column}: note: {text}{more}"
        for severity in SEVERITIES:
            for finding in report.findings:
                if finding.severity == severity:
                    yield _finding(report, finding)
                    yield from (
                        () if finding.complaint is None or severity == "note" else source_lines(finding.complaint)
                    )
        yield _sum(report)


def _finding(report: NetworkReport, found: NetworkFinding) -> Line:
    place = f"{report.path}:{found.line}:{found.column}: " if found.column else f"{report.path}: "
    return [
        Cell(place),
        Cell(f"{found.severity}: ", STYLES[found.severity]),
        Cell(f"{found.text} "),
        Cell(f"[{found.rule}]", "dim"),
    ]


def _sum(report: NetworkReport) -> Line:
    pdos = sum(count for _, _, count in report.nodes)
    links = f", {plural(report.links, 'link')}" if report.links else ""
    counted = report.count()
    found = ", ".join(plural(counted[severity], severity) for severity in SEVERITIES if counted[severity])
    if report.unread:
        return f"{report.path}: not checked; {found}"
    if report.bus:
        return f"{report.path} against {report.bus}: {plural(len(report.nodes), 'node')}; {found or 'no error'}"
    if report.said:
        found = f"{found + ', and ' if found else ''}{report.said} as said of the file"
    received = "" if report.heard is None else f", heard {report.heard[0]:.1f} s, {plural(report.heard[1], 'frame')}"
    nodes = plural(len(report.nodes), "node")
    folded = f"; {report.folded} more about PDOs that it does not name (--all shows them)" if report.folded else ""
    return f"{report.path}: {nodes}, {plural(pdos, 'PDO')}{links}{received}; {found or 'no error'}{folded}"

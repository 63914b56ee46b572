"""The text of a network's check."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.answers.check_lines import STYLES
from dvtcli.cli.view.error_lines import source_lines
from dvtcli.cli.view.lines import Cell, Line
from dvtcli.domain.text import join_some, plural
from dvtcli.operations.results.checked_files import SEVERITIES

if TYPE_CHECKING:
    from dvtcli.operations.results.checked_networks import NetworkFinding, NetworkReport, NetworksChecked


#: number from which findings of one cause are one line: each error must be corrected, so more of them stay apart
_MANY = {"error": 6, "warning": 3, "note": 3}
#: what differs between findings of one cause: node, PDO, object and its name, CAN-ID, and a line of an EDS
_PLACES = re.compile(
    r"\b(?:node \d+|[RT]PDO\d+|0x[0-9A-F]+(?::[0-9A-F]{2})?|[0-9A-F]{4}:[0-9A-F]{2}|\S+\.\w+:\d+)\b|\"[^\"]*\""
)


def check_lines(result: NetworksChecked, _width: int) -> Iterator[Line]:
    """Findings with their places, the worst first, those of one cause in one line, and a line for each file."""
    for report in result.reports:
        is_alone, is_folded = len(report.rules) == 1, False
        for severity in SEVERITIES:
            found = [finding for finding in report.findings if finding.severity == severity]
            if severity == "note":
                yield from _notes_of_file(report)
            for finding, *others in [[each] for each in found] if is_alone else _by_cause(found):
                is_folded |= bool(others)
                yield _finding(report, finding, others)
                if finding.complaint is not None and severity != "note":
                    yield from source_lines(finding.complaint)
        yield f"{_sum(report)}{' (--rule NAME lists each finding of a rule)' if is_folded else ''}"


def _notes_of_file(report: NetworkReport) -> Iterator[Line]:
    for line, column, times, text in report.notes:
        more = f" ({times} times)" if times > 1 else ""
        yield f"{report.path}:{line}:{column}: note: {text}{more}"


def _by_cause(findings: list[NetworkFinding]) -> Iterator[list[NetworkFinding]]:
    """Yield *findings*, those of a rule that differ in nodes, PDOs, objects and CAN-IDs only together if many."""
    causes: dict[tuple[str, str], list[NetworkFinding]] = {}
    for finding in findings:
        causes.setdefault((finding.rule, _PLACES.sub("", finding.text)), []).append(finding)
    for cause in causes.values():
        yield from [cause] if len(cause) >= _MANY[cause[0].severity] else ([finding] for finding in cause)


def _finding(report: NetworkReport, found: NetworkFinding, others: list[NetworkFinding]) -> Line:
    place = f"{report.path}:{found.line}:{found.column}: " if found.column else f"{report.path}: "
    return [
        Cell(place),
        Cell(f"{found.severity}: ", STYLES[found.severity]),
        Cell(f"{found.text} "),
        Cell(_more(found, others), "dim"),
        Cell(f"[{found.rule}]", "dim"),
    ]


def _more(found: NetworkFinding, others: list[NetworkFinding]) -> str:
    """Count *found* and *others*, and name the nodes and lines of the others."""
    if not others:
        return ""
    by_node = dict.fromkeys(other.node for other in others if other.node not in (None, found.node))
    nodes = f"node {join_some([str(node) for node in by_node])}; " if by_node else ""
    lines = join_some([str(line) for line in dict.fromkeys(finding.line for finding in others if finding.column)])
    also = f"{nodes}line {lines}" if lines else nodes.removesuffix("; ")
    return f"({len(others) + 1} times{also and f': also {also}'}) "


def _sum(report: NetworkReport) -> str:
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

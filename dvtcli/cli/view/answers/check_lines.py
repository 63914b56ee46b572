"""The text of `check` and `eds check`: findings by file and line, node or frame, then the sum."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.error_lines import source_lines
from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.text import join_some, plural
from dvtcli.operations.results.checked_files import SEVERITIES, FileFinding, FileReport, FileReports

if TYPE_CHECKING:
    from dvtcli.operations.results.checked_networks import NetworkFinding, NetworkReport, NetworksChecked
    from dvtcli.operations.results.checked_recordings import RecordingFinding, RecordingReport, RecordingsChecked

STYLES = {"error": "red", "warning": "yellow", "note": "cyan"}
#: Maximum number of causes per rule; `--rule` shows every finding, and other formats always have all.
_SHOWN = 10
#: number from which findings of one cause are one line: each error must be corrected, so more of them stay apart
_MANY = {"error": 6, "warning": 3, "note": 3}
#: what differs between findings of one cause: node, PDO, object and its name, CAN-ID, and a line of an EDS
_PLACES = re.compile(
    r"\b(?:node \d+|[RT]PDO\d+|0x[0-9A-F]+(?::[0-9A-F]{2})?|[0-9A-F]{4}:[0-9A-F]{2}|\S+\.\w+:\d+)\b|\"[^\"]*\""
)


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


def network_check_lines(result: NetworksChecked, _width: int) -> Iterator[Line]:
    """Findings with their places, the worst first, those of one cause in one line, and a line for each file."""
    for report in result.reports:
        is_alone, is_folded = len(report.rules) == 1, False
        for severity in SEVERITIES:
            found = [finding for finding in report.findings if finding.severity == severity]
            if severity == "note":
                yield from _notes_of_file(report)
            for finding, *others in [[each] for each in found] if is_alone else _network_by_cause(found):
                is_folded |= bool(others)
                yield _network_finding(report, finding, others)
                if finding.complaint is not None and severity != "note":
                    yield from source_lines(finding.complaint)
        yield f"{_sum(report)}{' (--rule NAME lists each finding of a rule)' if is_folded else ''}"


def _notes_of_file(report: NetworkReport) -> Iterator[Line]:
    for line, column, times, text in report.notes:
        more = f" ({times} times)" if times > 1 else ""
        yield f"{report.path}:{line}:{column}: note: {text}{more}"


def _network_by_cause(findings: list[NetworkFinding]) -> Iterator[list[NetworkFinding]]:
    """Yield *findings*, those of a rule that differ in nodes, PDOs, objects and CAN-IDs only together if many."""
    causes: dict[tuple[str, str], list[NetworkFinding]] = {}
    for finding in findings:
        causes.setdefault((finding.rule, _PLACES.sub("", finding.text)), []).append(finding)
    for cause in causes.values():
        yield from [cause] if len(cause) >= _MANY[cause[0].severity] else ([finding] for finding in cause)


def _network_finding(report: NetworkReport, found: NetworkFinding, others: list[NetworkFinding]) -> Line:
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

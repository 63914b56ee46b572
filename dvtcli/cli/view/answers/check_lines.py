"""The text of `check` and `eds check`: findings by file and line, node or frame, then the sum."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from dvtcli.cli.view.error_lines import MANY, PDO_CAN_ID, by_cause, source_lines
from dvtcli.cli.view.lines import Cell, Line, Table, part
from dvtcli.domain.text import plural, some_nodes, some_of
from dvtcli.operations.results.checks import SEVERITIES, FileFinding, FileReport, FileReports

if TYPE_CHECKING:
    from dvtcli.domain.hint import Hint
    from dvtcli.operations.results.checks import (
        NetworkFinding,
        NetworkReport,
        NetworksChecked,
        RecordingFinding,
        RecordingReport,
        RecordingsChecked,
    )

STYLES = {"error": "red", "warning": "yellow", "note": "cyan"}
#: Maximum number of causes per rule; `--rule` shows every finding, and other formats always have all.
_SHOWN = 10
#: number from which only the first error of a rule has an excerpt of the file: each error has its own line, since each
#: must be corrected
_MANY_ERRORS = 6


def check_lines(result: FileReport, width: int) -> Iterator[Line]:
    """Show a file's findings with lines, a line for each rule with findings, and the sum."""
    times = Counter(finding.rule for finding in result.findings)
    is_alone = len(result.rules) == 1
    most = len(result.findings) if is_alone else _SHOWN
    causes = [[finding] for finding in result.findings] if is_alone else by_cause(result.findings, _without_object)
    said: Counter[str] = Counter()
    shown: Counter[str] = Counter()
    for finding, *others in causes:
        said[finding.rule] += 1
        if said[finding.rule] > most:
            continue
        shown[finding.rule] += 1 + len(others)
        more = f"({len(others) + 1} times: also {some_of('line', [one.line for one in others])}) " if others else ""
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


def _without_object(finding: FileFinding) -> str:
    return finding.text.removeprefix(finding.object)


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
        unseen = _unseen(report)
        found = found or ("no problem" if len(report.unseen) < report.described or not unseen else "")
        said = "; ".join(filter(None, (found, unseen)))
        yield f"{report.path}: {plural(report.frames, 'frame')} in {seconds:.1f} s; {said}"


def _unseen(report: RecordingReport) -> str:
    """Name the nodes of the network file that sent nothing, empty for none."""
    if not report.unseen:
        return ""
    if len(report.unseen) == report.described:
        return "no node of the network file sent anything, so nothing of them was checked"
    return f"{some_nodes(report.unseen)} of the network file sent nothing"


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
    """Findings with their places, the worst first, and a line for each file.

    Warnings and notes that say the same of several nodes or PDOs are one line.
    """
    for report in result.reports:
        is_alone, is_folded = len(report.rules) == 1, False
        yield from _errors(report, with_excerpts=is_alone)
        for severity in SEVERITIES[1:]:
            found = [finding for finding in report.findings if finding.severity == severity]
            if severity == "note":
                yield from _notes_of_file(report)
            causes = [[each] for each in found] if is_alone else by_cause(found, _without_place, MANY)
            for finding, *others in causes:
                is_folded |= bool(others)
                yield _network_finding(report, finding, others)
                if finding.complaint is not None and severity != "note":
                    yield from source_lines(finding.complaint)
                yield from _hint(finding)
        yield f"{_sum(report)}{'; --rule NAME alone lists each finding of that rule' if is_folded else ''}"


def _errors(report: NetworkReport, *, with_excerpts: bool) -> Iterator[Line]:
    """A line for each error, *with_excerpts* of the file or if a rule has few errors."""
    errors = [finding for finding in report.findings if finding.severity == "error"]
    times, shown = Counter(finding.rule for finding in errors), set[str]()
    hinted: set[tuple[str, Hint | str | None]] = set()
    for finding in errors:
        yield _network_finding(report, finding, [])
        is_shown = with_excerpts or times[finding.rule] < _MANY_ERRORS or finding.rule not in shown
        if finding.complaint is not None and is_shown:
            shown.add(finding.rule)
            yield from source_lines(finding.complaint)
        if is_shown or (finding.rule, finding.hint) not in hinted:
            hinted.add((finding.rule, finding.hint))
            yield from _hint(finding)


def _hint(finding: NetworkFinding) -> Iterator[Line]:
    if finding.hint:
        yield [Cell("  hint    ", "dim"), part(finding.hint)]


def _notes_of_file(report: NetworkReport) -> Iterator[Line]:
    for line, column, times, text in report.notes:
        more = f" ({times} times)" if times > 1 else ""
        yield f"{report.path}:{line}:{column}: note: {text}{more}"


def _without_place(found: NetworkFinding) -> str:
    """The text of *found* without its node, PDO, the PDO's CAN-ID, and object; all other values remain."""
    places = []
    if found.node is not None:
        places.append(rf"node {found.node}")
    if found.pdo is not None:
        places.append(found.pdo.upper())
        if len(can_ids := set(PDO_CAN_ID.findall(found.text))) == 1:
            places.extend(can_ids)
    if found.object:
        index, _, sub_index = found.object.partition(":")
        places += [rf"0x{index}(?::{sub_index})?", found.object]
    return re.sub(rf"\b(?:{'|'.join(places)})\b", "…", found.text) if places else found.text


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
    """Count *found* and *others*, and name all places of the others."""
    if not others:
        return ""
    nodes: dict[str, dict[int, list[int]]] = {}  # by PDO or object: the CAN-IDs named in the texts about each node
    for other in others:
        numbers, what = nodes.setdefault(_what(other), {}), _what(other)
        if other.node is not None and (what or other.node != found.node):
            named_ids = set(PDO_CAN_ID.findall(other.text)) if other.pdo is not None else ()
            numbers.setdefault(other.node, []).extend(int(can_id, 16) for can_id in named_ids)
    also = []
    for what, numbers in nodes.items():
        who = f"node{'s' * (len(numbers) > 1)} {_ranges(numbers)}" if numbers else ""
        named = _can_ids_of(numbers)
        is_plain = len(nodes) == 1 and what == _what(found) and who
        also.append((who if is_plain else " of ".join(part for part in (what, who) if part)) + named)
    if lines := {other.line for other in others if other.column} - {found.line}:
        also.append(f"line {_ranges(lines)}")
    places = "; ".join(part for part in also if part)
    return f"({len(others) + 1} times{places and f': also {places}'}) "


def _can_ids_of(nodes: Mapping[int, Sequence[int]]) -> str:
    """Name the CAN-ID of each of *nodes* in their order, in parentheses; empty unless each node has one."""
    can_ids = [can_id for node in sorted(nodes) for can_id in nodes[node]]
    if not can_ids or any(len(of_node) != 1 for of_node in nodes.values()):
        return ""
    is_ascending = can_ids == sorted(set(can_ids))
    return f" ({_ranges(can_ids, '0x{:X}') if is_ascending else ', '.join(map('0x{:X}'.format, can_ids))})"


def _what(found: NetworkFinding) -> str:
    """The PDO or object of *found*, as its text names it; empty for neither."""
    if found.pdo is not None:
        return found.pdo.upper()
    return f"0x{found.object}" if found.object else ""


def _ranges(numbers: Iterable[int], form: str = "{}") -> str:
    """Write *numbers* in order, each in *form*, three and more in a row as `2-4`."""
    runs: list[list[int]] = []
    for number in sorted(set(numbers)):
        if runs and runs[-1][-1] == number - 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(
        f"{form.format(run[0])}-{form.format(run[-1])}" if len(run) > 2 else ", ".join(map(form.format, run))
        for run in runs
    )


def _sum(report: NetworkReport) -> str:
    pdos = sum(count for _, _, count in report.nodes)
    links = f", {plural(report.links, 'link')}" if report.links else ""
    counted = report.count()
    counted["note"] += sum(times for _, _, times, _ in report.notes)
    found = ", ".join(plural(counted[severity], severity) for severity in SEVERITIES if counted[severity])
    if report.unread:
        return f"{report.path}: not checked; {found}"
    if report.bus:
        return f"{report.path} against {report.bus}: {plural(len(report.nodes), 'node')}; {found or 'no error'}"
    if report.said:
        found = f"{found + ', and ' if found else ''}{report.said} of the file (above)"
    received = (
        "" if report.heard is None else f", {plural(report.heard[1], 'frame')} received in {report.heard[0]:.1f} s"
    )
    nodes = plural(len(report.nodes), "node")
    folded = f"; {report.folded} more about PDOs that it does not name (--all shows them)" if report.folded else ""
    return f"{report.path}: {nodes}, {plural(pdos, 'PDO')}{links}{received}; {found or 'no error'}{folded}"

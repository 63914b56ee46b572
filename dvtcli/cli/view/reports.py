"""Reports for CI: findings, comparisons and a script's lines as JUnit XML, GitHub's commands, and SARIF 2.1.0."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote
from xml.etree import ElementTree as ET

from dvtcli.cli.view.answers.compare_lines import value_text
from dvtcli.cli.view.lines import Line
from dvtcli.cli.view.typed_hints import advised, error_text
from dvtcli.domain.plan import PdoChange, step_text
from dvtcli.domain.text import join_some, plural, safe
from dvtcli.errors import InputFileError, RuleError
from dvtcli.operations.results.checks import SEVERITIES, FileFinding, Report, Reported
from dvtcli.operations.results.comparisons import Compared, WholeCompared
from dvtcli.operations.results.networks import NetworkPlanned, differing, parameter_texts
from dvtcli.version import __version__

if TYPE_CHECKING:
    from dvtcli.domain.network.network_plan import MissingObject, NodePlan
    from dvtcli.domain.plan import Change
    from dvtcli.errors import DvtcliError
    from dvtcli.operations.results import ComparedNodes
    from dvtcli.operations.results.comparisons import ObjectDifference


@dataclass(frozen=True, slots=True)
class Case:
    """A PDO or object of a *node* or a file; *differences* are texts, empty if none.

    *level* is `error`, `warning` or `notice`, or `skipped` if not checked; *file* with *line* and *column* (0: unknown)
    is the place of the wanted value.
    """

    node: int | str
    name: str
    differences: tuple[str, ...] = ()
    level: str = "error"
    file: str = ""
    line: int = 0
    column: int = 0

    @property
    def where(self) -> str:
        """The owner of the case for display."""
        return self.node if isinstance(self.node, str) else f"node {self.node}"


def cases_of(result: NetworkPlanned | Compared | ComparedNodes | WholeCompared) -> Iterator[Case]:
    """Return every case of *result*, node by node."""
    if isinstance(result, NetworkPlanned):
        for node in result.plan.nodes:
            yield from _planned(result, node)
        yield from _lacking(result.plan.lacking, result.plan.file)
    elif isinstance(result, Compared):
        yield from _compared(result)
    elif isinstance(result, WholeCompared):
        yield from _whole_device(result)
    else:
        for compared in result.nodes:
            yield from _compared(compared)
        yield from _lacking(result.lacking, result.nodes[0].against)


def _planned(result: NetworkPlanned, node_plan: NodePlan) -> Iterator[Case]:
    """Return differences: errors if requested, else notices of planned writes by `apply`."""
    level = "error" if result.tells else "notice"
    if not node_plan.is_read:
        trusted = ("not read: its stamp (0x1020) is that of the file",)
        yield Case(node_plan.node_id, "stamp", trusted, "skipped", result.plan.file, node_plan.line)
    unreadable = node_plan.plan.unreadable
    for change in node_plan.plan.changes:
        is_compared = change not in unreadable
        differences = tuple(_differences(node_plan, change)) if is_compared else ("not compared: it is write-only",)
        case_level = level if is_compared else "skipped"
        yield Case(node_plan.node_id, change.label, differences, case_level, result.plan.file, _line(node_plan, change))
    for held in node_plan.holds:
        yield Case(node_plan.node_id, held.label, file=result.plan.file, line=_line(node_plan, held))
    for left in node_plan.remaining:
        differences = (f"differs, not written: {left.why}",)
        yield Case(node_plan.node_id, left.object, differences, level, result.plan.file, node_plan.line)
    if node_plan.store and node_plan.unstored:
        differences = (f"not stored yet: {join_some(node_plan.unstored)}",)
        yield Case(node_plan.node_id, "store", differences, level, result.plan.file, node_plan.line)
    for finding in node_plan.findings:
        level = "notice" if str(finding.severity) == "note" else "warning"
        said = finding.complaint
        line, column = (node_plan.line, 0) if said is None else (said.line, said.column)
        yield Case(node_plan.node_id, finding.rule, (finding.text,), level, result.plan.file, line, column)


def _lacking(lacking: Sequence[MissingObject], file: str) -> Iterator[Case]:
    """Return PDOs and objects of *file* missing in nodes."""
    for lacked in lacking:
        line = 0 if lacked.complaint is None else lacked.complaint.line
        yield Case(lacked.node_id, lacked.label, (lacked.finding.text,), "error", file, line)


def _line(node_plan: NodePlan, change: Change) -> int:
    """Return the file's line for *change*: of its PDO or object, else its node."""
    if isinstance(change, PdoChange):
        return node_plan.lines.get(change.pdo, 0) or node_plan.line
    return node_plan.object_lines.get((change.step.index, change.step.sub_index), 0) or node_plan.line


def _differences(node_plan: NodePlan, change: Change) -> Iterator[str]:
    if isinstance(change, PdoChange):
        for key, was, will in differing(change):
            held, expected = parameter_texts(change, key, was, will)
            yield f"{key} is {held}, expected {expected}"
    else:
        known = node_plan.understood.get(change.step.object)
        held, expected = (step_text(change.step, data, known) for data in (change.step.before, change.step.after))
        why = "" if change.step.reason == "write" else f" ({change.step.reason})"
        yield f"is {held}, expected {expected}{why}"


def _compared(one: Compared) -> Iterator[Case]:
    found: dict[str, list[str]] = {label: [] for label in one.labels}
    for label, text in one.differences:
        found.setdefault(label, []).append(text)
    for label, texts in found.items():
        yield Case(one.node, label, tuple(texts), file=one.against, line=one.line_of(label))
    for label, frame, _ in one.frames:
        differences = () if frame else ("none came",)
        yield Case(one.node, f"frame of {label}", differences, file=one.against, line=one.line_of(label))


def _whole_device(result: WholeCompared) -> Iterator[Case]:
    """Return each differing setting, and equal settings together; other objects are notices on request."""
    where = result.second if result.node is None else result.node
    equal = result.objects - len(result.differences)
    yield Case(where, plural(equal, "equal setting"), file=result.first)
    if result.unlike:
        yield Case(where, "another device", (result.unlike,), "warning", result.first)
    for difference in result.differences:
        yield Case(where, _named(difference), (_sides(difference),), file=result.first)
    for difference in (*result.about, *result.apart) if result.shows_all else ():
        yield Case(where, _named(difference), (_sides(difference),), "notice", result.first)


def _named(one: ObjectDifference) -> str:
    return f"0x{one.object} {one.name}".rstrip()


def _sides(one: ObjectDifference) -> str:
    before, after = (one.unread or "-" if data is None else value_text(one, data) for data in (one.before, one.after))
    return f"is {after}, expected {before}"


@dataclass(slots=True)
class LineRan:
    """A line: place, output, and exit *code* (None: not run), with its *error*."""

    file: str
    number: int
    words: str
    code: int | None = None
    said: str = ""
    error: DvtcliError | None = None
    seconds: float = 0.0
    #: the next step of its error, as typed
    hint: str = ""


def why_failed(line: LineRan) -> str:
    """Return the error of *line* with its exit code."""
    said = f"exit code {line.code}" if line.error is None else error_text(line.error, str(line.error))
    return f"{said} (exit code {line.code})" if line.error is not None else said


def junit_lines(result: Reported, _width: int) -> Iterator[Line]:
    """Show a failure per rule that makes the file invalid; other findings go to the case's output."""
    yield from suites_text(_suite(report) for report in result.reports)


def suites_text(made: Iterable[ET.Element]) -> Iterator[Line]:
    """Return the text of the suites *made*, with sums."""
    suites = ET.Element("testsuites")
    suites.extend(made)
    for name in ("tests", "failures", "errors"):
        suites.set(name, str(sum(int(suite.attrib[name]) for suite in suites)))
    ET.indent(suites)
    yield '<?xml version="1.0" encoding="utf-8"?>'
    yield from ET.tostring(suites, "unicode").split("\n")


def _suite(result: Report) -> ET.Element:
    """Return the suite of a file."""
    found: dict[str, list[FileFinding]] = {}
    for finding in result.findings:
        found.setdefault(finding.rule, []).append(finding)
    failed = sum(any(map(result.is_bad, findings)) for findings in found.values())
    counts = {"tests": str(len(result.rules)), "failures": str(failed), "errors": "0"}
    suite = ET.Element("testsuite", {"name": f"{result.made_by} {safe(result.path)}", **counts})
    for rule in result.rules:
        case = ET.SubElement(suite, "testcase", {"classname": safe(result.path), "name": rule.name})
        findings = found.get(rule.name, [])
        if any(map(result.is_bad, findings)):
            said = {"type": rule.severity, "message": f"{rule.sense}: {plural(len(findings), 'finding')}"}
            ET.SubElement(case, "failure", said).text = _text(result, findings)
        elif findings:
            ET.SubElement(case, "system-out").text = _text(result, findings)
    return suite


def _text(result: Report, findings: list[FileFinding]) -> str:
    return "\n".join(safe(f"{_place(result, finding)}: {finding.severity}: {advised(finding)}") for finding in findings)


def _place(result: Report, found: FileFinding) -> str:
    return f"{result.path}:{found.line or 1}" + (f":{found.column}" if found.column else "")


def junit_case_lines(result: NetworkPlanned | Compared | ComparedNodes | WholeCompared, _width: int) -> Iterator[Line]:
    """Show a failure per differing PDO or object; findings about a node go to a case's output."""
    suites = (
        _case_suite(where, list(cases)) for where, cases in groupby(cases_of(result), key=lambda case: case.where)
    )
    yield from suites_text(suites)


def _case_suite(where: str, cases: list[Case]) -> ET.Element:
    failed = [case for case in cases if _fails(case)]
    counts = {"tests": str(len(cases)), "failures": str(len(failed)), "errors": "0"}
    if skipped := sum(case.level == "skipped" for case in cases):
        counts["skipped"] = str(skipped)
    suite = ET.Element("testsuite", {"name": safe(where), **counts})
    for case in cases:
        element = ET.SubElement(
            suite, "testcase", {"classname": safe(f"{case.file}.{where.replace(' ', '')}"), "name": safe(case.name)}
        )
        place = f"{case.file}:{case.line}:{case.column}: " if case.column else ""
        text = "\n".join(safe(f"{place}{said}") for said in case.differences)
        if _fails(case):
            ET.SubElement(element, "failure", {"type": "differs", "message": safe(case.differences[0])}).text = text
        elif case.level == "skipped":
            ET.SubElement(element, "skipped", {"message": safe(case.differences[0])})
        elif text:
            ET.SubElement(element, "system-out").text = text
    return suite


def _fails(case: Case) -> bool:
    return bool(case.differences) and case.level == "error"


def junit_error_lines(error: DvtcliError) -> Iterator[Line]:
    """Show the failure as a test case with an error, to avoid an empty report."""
    complaints = error.complaints if isinstance(error, InputFileError | RuleError) else ()
    suite = ET.Element("testsuite", {"name": "dvtcli", "tests": "1", "failures": "0", "errors": "1"})
    element = ET.SubElement(suite, "testcase", {"classname": "dvtcli", "name": error.slug})
    texts = [
        *(f"{complaint.place}: {complaint.text}" for complaint in complaints),
        *(text for _, text in error.details),
    ]
    said = {"type": error.slug, "message": safe(error_text(error, str(error)))}
    ET.SubElement(element, "error", said).text = "\n".join(map(safe, texts))
    yield from suites_text([suite])


def junit_script_lines(lines: Sequence[LineRan]) -> Iterator[Line]:
    """Show a suite per script, a test case per line; unreached lines are skipped."""
    by_file = sorted(lines, key=lambda line: (line.file != lines[0].file, line.file))
    yield from suites_text(_script_suite(file, list(ran)) for file, ran in groupby(by_file, key=lambda line: line.file))


def _script_suite(file: str, lines: list[LineRan]) -> ET.Element:
    counts = {
        "tests": str(len(lines)),
        "failures": str(sum(bool(line.code) for line in lines)),
        "errors": "0",
        "skipped": str(sum(line.code is None for line in lines)),
    }
    suite = ET.Element("testsuite", {"name": safe(file), **counts})
    for line in lines:
        place = {"file": safe(line.file), "line": str(line.number), "time": f"{line.seconds:.3f}"}
        name = safe(f"{line.number}: {line.words}")
        case = ET.SubElement(suite, "testcase", {"classname": safe(line.file), "name": name, **place})
        if line.code is None:
            ET.SubElement(case, "skipped", {"message": "not reached"})
        elif line.code:
            _failure(case, line)
        if line.said:
            ET.SubElement(case, "system-out").text = "\n".join(map(safe, line.said.splitlines()))
    return suite


def _failure(case: ET.Element, line: LineRan) -> None:
    kind = "interrupted" if line.error is None else line.error.slug
    failure = ET.SubElement(case, "failure", {"type": kind, "message": safe(why_failed(line))})
    if line.error is not None:
        rows = [
            ("why", line.error.why),
            ("hint", line.hint),
            ("state", line.error.state),
            *line.error.details,
        ]
        failure.text = "\n".join(safe(f"{label}: {text}") for label, text in rows if text)


#: the command for each severity, and for each level of a case, worst first
_COMMANDS = {"error": "error", "warning": "warning", "note": "notice", "notice": "notice", "skipped": "notice"}


def github_lines(result: Reported, _width: int) -> Iterator[Line]:
    """Show a command per finding, errors first, and each file's sum: GitHub shows ten of a kind and step."""
    reports = result.reports
    for severity in SEVERITIES:
        for report in reports:
            for finding in report.findings:
                if finding.severity == severity:
                    yield workflow_command(
                        severity,
                        report.path,
                        finding.line or 1,
                        finding.rule,
                        advised(finding),
                        finding.column,
                        finding.end_column,
                    )
    for report in reports:
        counted = report.count()
        found = ", ".join(plural(counted[severity], severity) for severity in SEVERITIES)
        yield line_without_command(f"{report.path}: {found}")


def escaped_message(text: str) -> str:
    """Escape *text* for the message of a workflow command."""
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def line_without_command(text: str) -> str:
    """Return *text*, beginning with a path, as a line that is not a workflow command: `::x::`, `##[x]`."""
    plain = text.replace("##[", "## [")
    return f"./{plain}" if plain.lstrip().startswith("::") else plain


def escaped_property(text: str) -> str:
    """Escape *text* for a property of a workflow command."""
    return escaped_message(text).replace(":", "%3A").replace(",", "%2C")


def github_case_lines(result: NetworkPlanned | Compared | ComparedNodes | WholeCompared, _width: int) -> Iterator[Line]:
    """Show a command per difference, errors first, and the sum: GitHub shows ten of a kind."""
    cases = list(cases_of(result))
    for level in _COMMANDS:
        for case in cases:
            if case.differences and case.level == level:
                text = f"{case.name} of {case.where}: {'; '.join(case.differences)}"
                yield workflow_command(level, case.file, case.line, case.where, text, case.column)
    differing = sum(bool(case.differences) for case in cases)
    yield f"{plural(len(cases), 'case')}, {plural(differing, 'notice')} or worse"


def github_error_lines(error: DvtcliError) -> Iterator[Line]:
    """Show a command per complaint about a file, else for the failure, and for related failures."""
    complaints = error.complaints if isinstance(error, InputFileError | RuleError) else ()
    for complaint in complaints:
        yield workflow_command("error", complaint.file, complaint.line, "dvtcli", complaint.text, complaint.column)
    if not complaints:
        yield workflow_command("error", "", 0, error.slug, error_text(error, str(error)))
    for label, text in error.details:
        if label == "also":
            yield workflow_command("error", "", 0, error.slug, text)


def workflow_command(
    level: str, file: str, line: int, title: str, text: str, column: int = 0, end_column: int = 0
) -> str:
    """Return a workflow command of *level* for a place, with possibly empty parts."""
    places = (("file", file), ("line", line), ("col", column), ("endColumn", end_column), ("title", title))
    words = ",".join(f"{key}={escaped_property(str(value))}" for key, value in places if value)
    return f"::{_COMMANDS[level]} {words}::{escaped_message(text)}"


def github_script_lines(lines: Sequence[LineRan]) -> Iterator[Line]:
    """Show each line's output in a group, an error per failure, and the number of lines.

    A device's text must not begin a line: it could be a workflow command.
    """
    for line in lines:
        if line.said:
            yield f"::group::{escaped_message(safe(line.words))}"
            yield from (f"| {safe(text)}" for text in line.said.splitlines())
            yield "::endgroup::"
        if line.code:
            yield workflow_command("error", line.file, line.number, line.words.partition(" ")[0], why_failed(line))
    failed, missed = sum(bool(line.code) for line in lines), sum(line.code is None for line in lines)
    yield f"{plural(len(lines), 'line')}, {failed} failed, {missed} not reached"


_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def sarif_lines(result: Reported, _width: int) -> Iterator[Line]:
    """Show the whole document, with all rules applied, for services that track fixed findings."""
    reports = result.reports
    rules = list({rule.name: rule for report in reports for rule in report.rules}.values())
    places = {rule.name: number for number, rule in enumerate(rules)}
    driver = {"name": "dvtcli", "version": __version__, "rules": [_rule(rule) for rule in rules]}
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "artifacts": [{"location": {"uri": _uri(report.path)}} for report in reports],
        "results": [_result(report, finding, places) for report in reports for finding in report.findings],
    }
    yield from json.dumps({"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]}, indent=1).splitlines()


def _result(report: Report, finding: FileFinding, places: Mapping[str, int]) -> dict[str, Any]:
    region = {"startLine": finding.line or 1}
    if finding.column:  # the end is the column behind it (3.30.8)
        region |= {"startColumn": finding.column, "endColumn": finding.end_column + 1}
    location = {"artifactLocation": {"uri": _uri(report.path)}, "region": region}
    return {
        "ruleId": finding.rule,
        "ruleIndex": places[finding.rule],
        "level": finding.severity,
        "message": {"text": advised(finding)},
        "locations": [{"physicalLocation": location}],
    }


def _rule(rule: Any) -> dict[str, Any]:
    return {
        "id": rule.name,
        "shortDescription": {"text": rule.sense},
        "help": {"text": f"{rule.sense} ({rule.source})"},
        "defaultConfiguration": {"level": rule.severity},
    }


def _uri(path: str) -> str:
    """Return a path as a reference; relative paths stay relative, for the service's repository."""
    return Path(path).as_uri() if Path(path).is_absolute() else quote(os.fsencode(Path(path).as_posix()))

"""JUnit's XML for CI servers: a suite per file, a test case per rule, difference or line of a script."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from dvtcli.cli.view.lines import Line
from dvtcli.cli.view.reports.cases import Case, cases_of, why_failed
from dvtcli.cli.view.typed_hints import advised, error_text
from dvtcli.domain.text import plural, safe
from dvtcli.errors import InputFileError, RuleError
from dvtcli.operations.results.checked_files import FileFinding, Report, Reported

if TYPE_CHECKING:
    from dvtcli.cli.view.reports.cases import LineRan
    from dvtcli.errors import DvtcliError
    from dvtcli.operations.results import Compared, ComparedNodes, NetworkPlanned, WholeCompared


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
    return f"{result.path}:{found.line}" + (f":{found.column}" if found.column else "")


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

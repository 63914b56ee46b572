"""JUnit's XML for CI servers: a suite per file, a test case per rule."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from xml.etree import ElementTree as ET

from dvtcli.cli.view.lines import Line
from dvtcli.domain.text import plural, safe
from dvtcli.operations.results.checked_files import FileFinding, Report, Reported


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
    return "\n".join(safe(f"{_place(result, finding)}: {finding.severity}: {finding.text}") for finding in findings)


def _place(result: Report, found: FileFinding) -> str:
    return f"{result.path}:{found.line}" + (f":{found.column}" if found.column else "")

"""Comparisons and failures as JUnit's XML: a suite for each node, a test case for each PDO or object."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from dvtcli.cli.view.lines import Line
from dvtcli.cli.view.reports.cases import Case, cases_of
from dvtcli.cli.view.reports.junit_lines import suites_text
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.domain.text import safe
from dvtcli.errors import InputFileError, RuleError

if TYPE_CHECKING:
    from dvtcli.errors import DvtcliError
    from dvtcli.operations.results import Compared, ComparedNodes, NetworkPlanned, WholeCompared


def junit_case_lines(result: NetworkPlanned | Compared | ComparedNodes | WholeCompared, _width: int) -> Iterator[Line]:
    """Show a failure per differing PDO or object; findings about a node go to a case's output."""
    suites = (_suite(where, list(cases)) for where, cases in groupby(cases_of(result), key=lambda case: case.where))
    yield from suites_text(suites)


def _suite(where: str, cases: list[Case]) -> ET.Element:
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
        text = "\n".join(safe(f"{place}{said}") for said in case.says)
        if _fails(case):
            ET.SubElement(element, "failure", {"type": "differs", "message": safe(case.says[0])}).text = text
        elif case.level == "skipped":
            ET.SubElement(element, "skipped", {"message": safe(case.says[0])})
        elif text:
            ET.SubElement(element, "system-out").text = text
    return suite


def _fails(case: Case) -> bool:
    return bool(case.says) and case.level == "error"


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

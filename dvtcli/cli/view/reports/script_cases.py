"""The lines of a script that ran, as tools of CI count them: JUnit's XML, and GitHub's workflow commands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from dvtcli.cli.view.lines import Line
from dvtcli.cli.view.reports.github_case_lines import workflow_command
from dvtcli.cli.view.reports.github_lines import as_data
from dvtcli.cli.view.reports.junit_lines import suites_text
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.domain.safe_text import safe
from dvtcli.domain.several import plural

if TYPE_CHECKING:
    from dvtcli.cli.scripts.script_report import LineRan


def junit_script_lines(lines: Sequence[LineRan]) -> Iterator[Line]:
    """A suite for each script, a test case for each of its lines; one that was not reached is skipped."""
    by_file = sorted(lines, key=lambda line: (line.file != lines[0].file, line.file))
    yield from suites_text(_suite(file, list(ran)) for file, ran in groupby(by_file, key=lambda line: line.file))


def _suite(file: str, lines: list[LineRan]) -> ET.Element:
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
    failure = ET.SubElement(case, "failure", {"type": kind, "message": safe(_why(line))})
    if line.error is not None:
        rows = [
            ("why", line.error.why),
            ("hint", line.hint),
            ("state", line.error.state),
            *line.error.details,
        ]
        failure.text = "\n".join(safe(f"{label}: {text}") for label, text in rows if text)


def _why(line: LineRan) -> str:
    said = f"exit code {line.code}" if line.error is None else error_text(line.error, str(line.error))
    return f"{said} (exit code {line.code})" if line.error is not None else said


def github_script_lines(lines: Sequence[LineRan]) -> Iterator[Line]:
    """What each line said, in a group, an error for each that failed, and how many lines there were.

    What a device says may not begin a line: it could be a workflow command.
    """
    for line in lines:
        if line.said:
            yield f"::group::{as_data(safe(line.words))}"
            yield from (f"| {safe(text)}" for text in line.said.splitlines())
            yield "::endgroup::"
        if line.code:
            yield workflow_command("error", line.file, line.number, line.words.partition(" ")[0], _why(line))
    failed, missed = sum(bool(line.code) for line in lines), sum(line.code is None for line in lines)
    yield f"{plural(len(lines), 'line')}, {failed} failed, {missed} not reached"

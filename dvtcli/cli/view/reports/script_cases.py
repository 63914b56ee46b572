"""The executed lines of a script for CI tools: JUnit's XML, and GitHub's workflow commands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from dvtcli.cli.view.lines import Line
from dvtcli.cli.view.reports.github_lines import escaped_message, workflow_command
from dvtcli.cli.view.reports.junit_lines import suites_text
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.domain.text import plural, safe

if TYPE_CHECKING:
    from dvtcli.cli.scripts.script_report import LineRan


def junit_script_lines(lines: Sequence[LineRan]) -> Iterator[Line]:
    """Show a suite per script, a test case per line; unreached lines are skipped."""
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
    """Show each line's output in a group, an error per failure, and the number of lines.

    A device's text must not begin a line: it could be a workflow command.
    """
    for line in lines:
        if line.said:
            yield f"::group::{escaped_message(safe(line.words))}"
            yield from (f"| {safe(text)}" for text in line.said.splitlines())
            yield "::endgroup::"
        if line.code:
            yield workflow_command("error", line.file, line.number, line.words.partition(" ")[0], _why(line))
    failed, missed = sum(bool(line.code) for line in lines), sum(line.code is None for line in lines)
    yield f"{plural(len(lines), 'line')}, {failed} failed, {missed} not reached"

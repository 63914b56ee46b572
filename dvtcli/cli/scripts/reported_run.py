"""Run a script for a report: collect the lines' output, and write the report to stdout."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING

from dvtcli.cli.boundary import exit_code_of
from dvtcli.cli.scripts.script_report import LineRan, ScriptReport

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.errors import DvtcliError

#: the writer of each report format
_REPORTS = {"github": "github_script_lines", "junit": "junit_script_lines"}


def reported_run(session: Conversation, file: str, run: Callable[[], int]) -> int:
    """Call *run* for the script *file*, and report its lines in the requested format; returns the exit code.

    Failures also go to stderr. An unusable file, a script with unknown lines (Tcl), and a failure after the last line
    are one case each.
    """
    output, outer = session.output, session.report
    output.failed = None
    name, stdout = output.format, output.stdout
    session.report = report = ScriptReport(output)
    output.stdout = report.kept
    try:
        with session.under(format="text"):
            whole = LineRan(file, 1, f"run {file}")
            whole.code = exit_code_of(session, run)
            whole.error, whole.said = output.failed, "" if report.lines else report.kept.getvalue()
            whole.number = _line_of(file, whole.error) or 1
    finally:
        output.stdout, session.report = stdout, outer
    cases = _cases(report, whole)
    for line in cases:
        if line.error is not None and line.error.hint:
            line.hint = output.hints(line.error.node).text(line.error.hint)
    make = getattr(import_module("dvtcli.cli.view.reports.script_cases"), _REPORTS[name])
    output.machine_lines(make(cases))
    return whole.code


def _cases(report: ScriptReport, whole: LineRan) -> list[LineRan]:
    """Return the executed lines, and the *whole* script if no line has its failure, or if no line ran."""
    if report.lines and (not whole.code or any(line.code for line in report.lines)):
        return report.lines
    return [*report.lines, whole]


def _line_of(file: str, error: DvtcliError | None) -> int:
    """Return the line of *file* for *error*, 0 for none."""
    place, _, number = ((error.place or "") if error is not None else "").rpartition(":")
    return int(number) if place == file and number.isdigit() else 0

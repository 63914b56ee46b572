"""Run a script: every line is parsed before the first line runs."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import click

from dvtcli.cli.boundary import exit_code_of
from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import FILE, CanopenType
from dvtcli.cli.runner_interface import runners
from dvtcli.operations.user.options import CASE_FORMATS

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.scripts.script_report import ScriptReport
    from dvtcli.cli.view.reports import LineRan
    from dvtcli.errors import DvtcliError


class SecondsType(CanopenType):
    """A time in seconds, 0.1…86400."""

    name = "seconds"

    def parse(self, text: str, ctx: click.Context | None) -> float:
        """The seconds; ValueError outside the range."""
        del ctx
        try:
            seconds = float(text)
        except ValueError:
            raise ValueError(f"{text!r} is not a number of seconds") from None
        if not 0.1 <= seconds <= 86_400:
            raise ValueError(f"{text}: a script may compute for 0.1…86400 s")
        return seconds


@click.command("run", cls=DvtCommand, short_help=__doc__, effect=Effect.RUNS, formats=CASE_FORMATS)
@click.argument("file", type=FILE)
@click.option(
    "--keep-going", is_flag=True, help="Go on after a line that fails; end with the first failure's exit code."
)
@click.option("--atomic", is_flag=True, help="Roll back all lines, on all nodes, if a line fails.")
@click.option(
    "--max-seconds",
    "most_seconds",
    type=SecondsType(),
    metavar="S",
    help="Time limit of a Tcl script's computing [600 s].",
)
@click.pass_context
def command(ctx: click.Context, /, file: str, keep_going: bool, atomic: bool, most_seconds: float | None) -> int:
    """Run the commands in FILE, or of stdin with `-`; a FILE.tcl is a Tcl script with the DVT's words (help dvt).

    A FILE.309 has lines for a CANopen gateway (CiA 309-3: SDO and NMT): they are checked and read back like commands.

    \b
    run scripts/pdo_config.dvt
    run setup.dvt --dry-run
    run setup.dvt --atomic
    run setup.dvt --format junit     a test case for each line, for CI
    run scripts/pdo_config.tcl
    """
    session: Conversation = ctx.obj
    run = partial(runners(ctx).file, session, file, keep_going=keep_going, atomic=atomic, most_seconds=most_seconds)
    if session.output.format not in CASE_FORMATS:
        return run()

    return reported_run(session, file, run)


#: the writer of each report format
_REPORTS = {"github": "github_script_lines", "junit": "junit_script_lines"}


def reported_run(session: Conversation, file: str, run: Callable[[], int]) -> int:
    """Call *run* for the script *file*, and report its lines in the requested format; returns the exit code.

    Failures also go to stderr. An unusable file, a script with unknown lines (Tcl), and a failure after the last line
    are one case each.
    """
    from dvtcli.cli.scripts.script_report import ScriptReport
    from dvtcli.cli.view import reports
    from dvtcli.cli.view.reports import LineRan

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
    output.machine_lines(getattr(reports, _REPORTS[name])(cases))
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

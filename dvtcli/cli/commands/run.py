"""Run a script: every line is parsed before the first line runs."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import FILE, CanopenType
from dvtcli.cli.runner_interface import runners
from dvtcli.operations.user.options import CASE_FORMATS

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation


class SecondsType(CanopenType):
    """A time in seconds, 0.1…86400."""

    name = "seconds"

    def parse(self, text: str, ctx: click.Context | None) -> float:
        """The seconds; ValueError outside the range."""
        del ctx
        try:
            seconds = float(text)
        except ValueError:
            raise ValueError(f"{text!r} is no number of seconds") from None
        if not 0.1 <= seconds <= 86_400:
            raise ValueError(f"{text}: a script may compute for 0.1…86400 s")
        return seconds


@click.command("run", cls=DvtCommand, short_help=__doc__, effect=Effect.RUNS, formats=CASE_FORMATS)
@click.argument("file", type=FILE)
@click.option(
    "--keep-going", is_flag=True, help="Go on after a line that fails; end with the first failure's exit code."
)
@click.option("--atomic", is_flag=True, help="Roll back all lines, on all nodes, if one fails.")
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
    from dvtcli.cli.scripts.reported_run import reported_run

    return reported_run(session, file, run)

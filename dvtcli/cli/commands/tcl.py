"""Run a line of Tcl with the DVT's words; alone, at the prompt, all lines until `exit`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import TEXT
from dvtcli.cli.runner_interface import runners
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation


@click.command("tcl", cls=DvtCommand, short_help=__doc__, effect=Effect.RUNS)
@click.argument("words", type=TEXT, nargs=-1, metavar="[LINE]")
@click.pass_context
def command(ctx: click.Context, /, words: tuple[str, ...]) -> int:
    """Run LINE as Tcl with the DVT's words (help dvt), in safe mode, and print its result.

    `dvtcli read OBJECT` returns the value, or a list of values. At the prompt, variables and procedures stay for the
    next line, and `tcl` alone accepts lines until `exit` or Ctrl-D. `run FILE.tcl` runs a Tcl script.

    \b
    tcl puts [expr 2*3]
    tcl sdo_rnx 1 0x6041 0
    tcl "set volts [expr {[dvtcli read battery_voltage] / 16.0}]"
    """
    session: Conversation = ctx.obj
    tcl = runners(ctx).tcl(session)
    if words:
        try:
            return tcl.run(" ".join(words))
        finally:
            if not session.at_prompt:
                tcl.close()
    if not session.at_prompt:
        raise UsageError("tcl needs a line of Tcl, or the prompt", hint="tcl puts [expr 2*3]; run FILE.tcl")
    tcl.on = True
    session.output.note("every line is now Tcl; `exit` or Ctrl-D returns to dvtcli")
    return 0

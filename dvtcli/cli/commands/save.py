"""Save this session's changes as a script."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.lexer import split
from dvtcli.cli.params import FILE
from dvtcli.cli.runner_interface import runners
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


@click.command("save", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.argument("file", type=FILE)
@click.option("--history", is_flag=True, help="Every step as typed, stores and NMT commands included.")
@click.option("--all", "everything", is_flag=True, help="The complete configuration of the node's PDOs.")
@click.pass_context
def command(ctx: click.Context, /, file: str, history: bool, everything: bool) -> Facts:
    """Write this session's changes to FILE as a script that requires the node's identity.

    \b
    save tpdo1.dvt
    save tpdo1.tcl             the same for Tcl
    save tpdo1.309             the same as lines that any CiA 309-3 gateway carries out
    save steps.dvt --history   each step that was taken
    save node.dvt --all        whatever the node's PDOs hold
    """
    from dvtcli.operations.session.save_script import ENDS, EVERYTHING, STEPS, save_script

    session: Session = ctx.obj
    if history and everything:
        raise UsageError("--history and --all exclude each other")
    if file.lower().endswith(".309"):
        from dvtcli.operations.gateway.session_as_lines import save_lines

        if history or everything:
            raise UsageError("gateway lines have the net changes of this session: leave out --history and --all")
        return save_lines(session, file)
    what = EVERYTHING if everything else STEPS if history else ENDS
    if file.lower().endswith(".tcl"):
        return save_script(session, file, what, _as_tcl)
    return save_script(session, file, what, read_back=partial(runners(ctx).parsed, ctx.obj))


def _as_tcl(text: str) -> str:
    """Convert script lines to Tcl: prefix `dvtcli`, and put special words in braces."""
    head, *lines = text.splitlines()
    shown = [
        line if line.startswith("#") else " ".join(["dvtcli", *map(_tcl_word, split(line))]) for line in lines if line
    ]
    return "\n".join([head, *shown, ""])


def _tcl_word(word: str) -> str:
    return word if word and not set(word) & set(' \t"[]{}$;#\\') else f"{{{word}}}"

"""Show the last exchange with the nodes, frame by frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import NumberType

if TYPE_CHECKING:
    from dvtcli.operations.results import Traced
    from dvtcli.operations.session.session import Session


@click.command("trace", cls=DvtCommand, short_help=__doc__, effect=Effect.READS)
@click.argument("which", type=click.Choice(["last"]), metavar="last")
@click.option(
    "--count",
    type=NumberType(1, 1024, "a count"),
    metavar="N",
    help="How many frames [32, or from the last refused write on].",
)
@click.pass_obj
def command(session: Session, /, which: str, count: int | None) -> Traced:  # noqa: ARG001 - there is one
    """Show the frames that were sent from here last, and those that answered them: SDO, LSS, EMCY and boot-ups, too.

    It sends nothing. At the prompt, and in a script, behind the line it is about; a run of its own shows the last
    exchange of the last run that a node refused something, or was silent to. A passcode is not shown.

    \b
    trace last
    trace last --count 8
    """
    from dvtcli.operations.frames.last_exchange import trace_last

    return trace_last(session, count)

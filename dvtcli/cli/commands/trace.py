"""Show the last exchange with the nodes, frame by frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._frame_options import only_option
from dvtcli.cli.params import NumberType

if TYPE_CHECKING:
    from dvtcli.operations.results import Traced
    from dvtcli.operations.session.session import Session


@click.command("trace", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.argument("which", type=click.Choice(["last"]), metavar="last")
@click.option(
    "--count",
    type=NumberType(1, 1024, "a count"),
    metavar="N",
    help="Number of frames [32, or from the last refused write on].",
)
@only_option
@click.pass_obj
def command(
    session: Session,
    /,
    which: str,  # noqa: ARG001 - there is one
    count: int | None,
    only: frozenset[str] | None,
) -> Traced:
    """Show the last frames that dvtcli sent, and their answers: SDO, LSS, EMCY and boot-up messages.

    It sends nothing. At the prompt and in a script it shows the frames of the lines before; a run of its own shows the
    last exchange of the last run in which a node refused or did not answer. A passcode is not shown.

    \b
    trace last
    trace last --count 8
    trace last --only sdo-abort,emcy
    """
    from dvtcli.operations.frames.last_exchange import trace_last

    return trace_last(session, count, only or frozenset())

"""Show a node's error register, error history and EMCY messages; clear the history."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect, Final
from dvtcli.cli.params import DurationType

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import Faults


def _final(params: Mapping[str, Any]) -> Final | None:
    return Final("faults --clear") if params["clear"] else None


@click.command(
    "faults",
    cls=DvtCommand,
    short_help=__doc__,
    effect=Effect.NONE,
    final=_final,
    each=lambda params: not params["watch"],
)
@click.option(
    "--clear", is_flag=True, help="Clear the error history (write 0 to 0x1003:00) and read back that it is empty."
)
@click.option("--watch", is_flag=True, help="Show the EMCY messages of all nodes as they come, until Ctrl-C.")
@click.option("--for", "duration_s", type=DurationType(), metavar="TIME", help="End --watch after TIME (500ms, 5s).")
@click.pass_obj
def command(session: Conversation, /, clear: bool, watch: bool, duration_s: float | None) -> Faults | None:
    """Show a node's error register, error history and received EMCY messages in words.

    The words come from the standard, and from the node's family if known, with advice. --clear does not remove the
    cause of an error and does not reset the drive. --watch with --json is one document a message.

    \b
    faults
    faults --clear
    faults --watch
    faults --watch --for 200ms --json
    """
    if clear and watch:
        raise click.UsageError(
            "--clear empties the history of one node, --watch shows all nodes: give only one of them"
        )
    if duration_s is not None and not watch:
        raise click.UsageError("--for belongs to --watch")
    if watch:
        from dvtcli.operations.frames.show_faults import watch_faults

        watch_faults(session, session.output.stream, duration_s)
        return None
    from dvtcli.operations.frames.show_faults import clear_faults, show_faults

    if not clear:
        return show_faults(session)
    session.is_noted = False
    return clear_faults(session)

"""Undo the last change or all of this session's, or restore an automatic backup."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import TEXT
from dvtcli.cli.runner_interface import runners
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.operations.results import Changed, ChangedNodes

_NEWEST = "newest"


class All(click.Choice[str]):
    """The word `all`; a PDO instead is refused, because undo reverts whole changes."""

    def get_invalid_choice_message(self, value: object, ctx: click.Context | None) -> str:  # noqa: ARG002
        """Return the message for another word."""
        return f"{value!r} is not 'all': undo reverts the last change, --all every change"


@click.command("undo", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES)
@click.argument("word", type=All(["all"], case_sensitive=False), required=False, metavar="[all]")
@click.option(
    "--all", "everything", is_flag=True, help="All changes of this session, on every node; else earlier changes."
)
@click.option(
    "--backup", type=TEXT, is_flag=False, flag_value=_NEWEST, metavar="[WHEN]",
    help="Restore an automatic backup: the newest, or that of a date and time.",
)  # fmt: skip
@click.pass_context
def command(ctx: click.Context, /, word: str | None, everything: bool, backup: str | None) -> Changed | ChangedNodes:
    """Revert the last change, on any node; on a real bus also a change of an earlier process.

    A change made on several nodes together, as by `apply`, is reverted on all of them; with -n on one node only.

    \b
    undo
    undo --all
    undo --backup 2026-11-22T04:11
    """
    everything = everything or word is not None
    if backup is None:
        from dvtcli.operations.changes.undo import undo

        return undo(ctx.obj, everything=everything)
    if everything:
        raise UsageError("--all and --backup exclude each other: a backup is everything")
    from dvtcli.operations.changes.undo import undo_to_backup

    rehearse = partial(runners(ctx).rehearsed, ctx.obj)
    return undo_to_backup(ctx.obj, rehearse, None if backup == _NEWEST else backup)

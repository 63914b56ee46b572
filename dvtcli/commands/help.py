"""Show all commands, or one with its options and examples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.params import TEXT
from dvtcli.shell import REGISTRY, DvtCommand, unknown_command

if TYPE_CHECKING:
    from dvtcli.results import Facts


@click.command("help", cls=DvtCommand, short_help=__doc__)
@click.argument("name", type=TEXT, required=False, metavar="[COMMAND]")
@click.pass_context
def command(ctx: click.Context, /, name: str | None) -> Facts:
    """Show all commands, or COMMAND with its options and examples.

    \b
    help
    help map
    """
    from dvtcli.results import Facts

    root = click.Context(REGISTRY, info_name="dvtcli")
    if name is None:
        text = REGISTRY.get_help(root)
    else:
        found = REGISTRY.get_command(root, name)
        if found is None:
            raise click.UsageError(unknown_command(name), ctx)
        text = found.get_help(click.Context(found, info_name=name))
    return Facts("help", (("text", text),), tuple(text.splitlines()))

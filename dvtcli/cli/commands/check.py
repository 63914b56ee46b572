"""Check network files: every error with its line and column, without a bus."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts

TASK = ("Scripts and files", 40)


@click.command("check", cls=DvtCommand, short_help=__doc__, effect=Effect.READS, needs_settings=False)
@click.argument("files", type=FILE, nargs=-1, required=True, metavar="FILE…")
def command(files: tuple[str, ...]) -> Facts:
    """Read network files (YAML) and name everything that is wrong in them, each with its line, column and a caret.

    Exit code 4 where something is wrong. Keys of other tools are notes. Files for dcfgen and ros2_canopen are network
    files, too. What only a node's dictionary knows, as names of objects, is not looked at.

    \b
    check press.yaml
    check press.yaml bus.yml
    """
    from dvtcli.operations.check_networks import check_networks

    return check_networks(files)

"""Check or show an EDS or DCF file, or add it to the collection that nodes are recognised by."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts, FileReport

TASK = ("Find nodes", 60)


@click.command("eds", cls=DvtCommand, short_help=__doc__, effect=Effect.READS, needs_settings=False)
@click.argument("action", type=click.Choice(["check", "show", "add"]), metavar="check|show|add")
@click.argument("file", type=FILE)
def command(action: str, file: str) -> Facts | FileReport:
    """Read FILE and say what is in it; `check` names everything odd with its line.

    \b
    eds check drive.eds
    eds show drive.eds
    eds add drive.eds       found from now on by the node's identity
    """
    from dvtcli.operations import eds_files

    if action == "check":
        return eds_files.check_eds(file)
    return eds_files.show_eds(file) if action == "show" else eds_files.add_eds(file)

"""Keep everything that can be read of a device in a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


@click.command("backup", cls=DvtCommand, short_help=__doc__, effect=Effect.READS)
@click.argument("file", type=FILE)
@click.option("--twice", is_flag=True, help="Read each object twice, and leave out what changed meanwhile.")
@click.pass_obj
def command(session: Session, /, file: str, twice: bool) -> Facts:
    """Read every object of the selected node, and keep what it holds in FILE: its EDS with values (.dcf or
    .xdc), or .jsonl.

    A .jsonl has what was refused, too, and takes devices without an EDS: then each index from 0x1000 to 0x9FFF is asked
    for, which takes minutes. Passcodes and programs are not read. `compare` says later what differs.

    The backups that dvtcli makes by itself before a change are others: they have the PDOs only, and `undo --backup`
    puts them back.

    \b
    backup press.dcf
    backup press.jsonl
    """
    from dvtcli.operations.whole_device.backup_device import backup_device

    return backup_device(session, file, twice=twice)

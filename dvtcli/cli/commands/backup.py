"""Save everything that can be read from a device to a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


@click.command("backup", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.argument("file", type=FILE)
@click.option(
    "--twice", is_flag=True, help="Read each object twice, and leave out values that changed between the reads."
)
@click.pass_obj
def command(session: Session, /, file: str, twice: bool) -> Facts:
    """Read every object of the selected node and save it to FILE: its EDS with values (.dcf or .xdc), or .jsonl.

    A .jsonl also lists refused objects. It needs no EDS: each index from 0x1000 to 0x9FFF is read, which takes minutes.
    Passcodes and programs are not read. `compare` shows differences later.

    The automatic backup before a change is separate: it has the PDOs only, and `undo --backup` restores it.

    \b
    backup press.dcf
    backup press.jsonl
    """
    from dvtcli.operations.devices.backup_device import backup_device

    return backup_device(session, file, twice=twice)

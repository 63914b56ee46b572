"""Write what a node's PDOs hold to a network file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session import Session

TASK = ("Scripts and files", 50)


@click.command("export", cls=DvtCommand, short_help=__doc__, effect=Effect.READS)
@click.argument("file", type=FILE)
@click.pass_obj
def command(session: Session, /, file: str) -> Facts:
    """Write every PDO of the selected node, as it is now, to FILE (.yaml), with the vendor and product that it is.

    Objects are named where the device's file names them, with their numbers behind. A PDO that is not whole is left
    out, and said.

    \b
    export press.yaml
    """
    from dvtcli.operations.export_network import export_node

    return export_node(session, file)

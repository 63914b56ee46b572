"""Write a whole network, or a folder of EDS files, to a network file."""

# ruff: noqa: N999 - the file is called as its command is

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import FILE, NODE_ID

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


@click.command("import", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.argument("file", type=FILE)
@click.argument("folder", type=FILE, required=False)
@click.option(
    "--from-manager",
    "manager",
    type=NODE_ID,
    metavar="NODE",
    help="Read what NODE, a CANopen manager, downloads to each node that boots (0x1F22).",
)
@click.pass_obj
def command(session: Session, /, file: str, folder: str | None, manager: int | None) -> Facts:
    """Write every PDO of every node that answers, as it is now, and the links between them, to FILE (.yaml).

    With `-n 1,5` these nodes only. With FOLDER, its EDS, DCF, XDD and XDC files are read instead of a bus: a DCF's
    node-ID counts, else the next free one; of a nodelist (.cpj) in it, or as FOLDER, its nodes and their DCFs. An RPDO
    with the CAN-ID of another node's enabled TPDO, and a layout that agrees, is a link.

    \b
    import press.yaml
    import press.yaml eds-files/     no bus is needed
    import press.yaml --from-manager 3
    """
    from dvtcli.operations.exchange.import_network import import_network

    return import_network(session, file, folder, manager)

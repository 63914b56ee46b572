"""Write a node's configuration to a file: a network file, a DCF, an XDC, a DBC file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._frame_options import dbc_options
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from dvtcli.operations.exchange.export_dbc import DbcOptions
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


@click.command("export", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.argument("file", type=FILE)
@click.option(
    "--twice",
    is_flag=True,
    help="DCF, XDC: read each object twice, and leave out values that changed between the reads.",
)
@click.pass_obj
@dbc_options
def command(session: Session, /, file: str, twice: bool, options: DbcOptions) -> Facts:
    """Write the selected node, as it is now, to FILE: its PDOs (.yaml), or all of its configuration (.dcf or .xdc).

    In a network file objects have the names of the device's file, with their numbers as comments. A PDO that cannot be
    read whole is left out and named.

    A DCF is the node's EDS, byte for byte, with a ParameterValue for each configuration object, and with the node-ID,
    bit rate and serial number. An XDC is the same in XML. What cannot be read is left out and named.

    A nodelist (.cpj) names the nodes that answer, or those of -n, each with its DCF beside it. A DBC file has the
    enabled PDOs of all these nodes, with units, scales, value names and receivers.

    \b
    export press.yaml
    export press.dcf
    export press.xdc
    export nodelist.cpj
    export press.dbc
    export press.dbc --with emcy,heartbeat
    export press.dbc --split-bits    a signal for each bit of the statusword
    """
    from dvtcli.operations.exchange.export_file import export_file

    return export_file(session, file, twice=twice, options=options)

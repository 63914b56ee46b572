"""Map objects into a PDO: check, disable, write, enable, read back; roll back on failure."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._pdo_options import pdo_options, request
from dvtcli.cli.object_params import ENTRY, EntryWord, Objects
from dvtcli.cli.pdo_params import PDO, NodePdo
from dvtcli.operations.changes.change import configure

if TYPE_CHECKING:
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session.session import Session


@click.command("map", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES)
@click.argument("pdo", type=PDO)
@click.argument("objects", cls=Objects, type=ENTRY, nargs=-1, required=True, metavar="OBJECT...")
@pdo_options
@click.pass_obj
def command(session: Session, /, pdo: NodePdo, objects: tuple[EntryWord, ...], **options: Any) -> Changed:
    """Map OBJECTs into PDO, in frame order, and enable it.

    \b
    map tpdo1 6C01:1 606C 6041 --cob-id 0x201 --sync 1
    map tpdo2 velocity_actual_value statusword --event --timer 100
    map rpdo1 dummy/16 2020:4 2020:2          skip 16 bits first
    """
    asked = request(options, enabled=True)
    node = session.node(pdo.node_id)
    mapped = tuple(word.resolve(node) for word in objects)
    return configure(session, node, {pdo.pdo: replace(asked, objects=mapped)})

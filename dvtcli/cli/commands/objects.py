"""Search the object dictionary: names, types, access, mappable objects."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import TEXT

if TYPE_CHECKING:
    from dvtcli.operations.results import ObjectListing
    from dvtcli.operations.session.session import Session


@click.command("objects", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.argument("text", type=TEXT, required=False)
@click.option("--mappable", type=click.Choice(["tpdo", "rpdo"]), help="Only objects that such a PDO can map.")
@click.pass_obj
def command(session: Session, /, text: str | None, mappable: str | None) -> ObjectListing:
    """List objects whose number or name contains TEXT.

    \b
    objects velocity
    objects 6C01
    objects --mappable tpdo
    """
    from dvtcli.operations.objects.search_objects import search_objects

    return search_objects(session, text, mappable)

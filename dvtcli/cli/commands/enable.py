"""Enable PDOs: clear bit 31 of their COB-IDs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._pdo_options import one_node
from dvtcli.cli.params import Listed
from dvtcli.cli.pdo_params import PDO, NodePdo
from dvtcli.domain.request import Switched
from dvtcli.operations.pdos.edit_pdos import switch

if TYPE_CHECKING:
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session.session import Session


@click.command("enable", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES)
@click.argument("pdos", cls=Listed, type=PDO, nargs=-1, required=True, metavar="PDO...")
@click.pass_obj
def command(session: Session, /, pdos: tuple[NodePdo, ...]) -> Changed:
    """Enable each PDO with its present mapping.

    \b
    enable tpdo1 tpdo2
    """
    return switch(session, *one_node(pdos), Switched(enabled=True))

"""Clear PDOs: no mapping, and disabled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._pdo_options import one_node
from dvtcli.cli.params import CanopenType, Listed
from dvtcli.cli.pdo_params import PDO, NodePdo
from dvtcli.domain.request import Cleared
from dvtcli.operations.pdos.edit_pdos import clear_all, switch

if TYPE_CHECKING:
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session.session import Session


class PdoOrAll(CanopenType):
    """A PDO, or the word `all`."""

    name = "pdo"

    def parse(self, text: str, ctx: click.Context | None) -> NodePdo | None:
        """Return the PDO, or None for all."""
        return None if text.lower() == "all" else PDO.parse(text, ctx)


@click.command("clear", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES)
@click.argument("pdos", cls=Listed, type=PdoOrAll(), nargs=-1, required=True, metavar="PDO...|all")
@click.pass_obj
def command(session: Session, /, pdos: tuple[NodePdo | None, ...]) -> Changed:
    """Disable each PDO and empty its mapping.

    With `all`, a PDO that cannot be cleared (its COB-ID is read-only or cannot be read) stays as it is and is named.

    \b
    clear tpdo3 rpdo3
    clear all          every PDO of the node that can be cleared
    """
    if None not in pdos:
        return switch(session, *one_node(pdo for pdo in pdos if pdo is not None), Cleared())
    return clear_all(session)

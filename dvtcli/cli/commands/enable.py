"""Enable PDOs: clear bit 31 of their COB-IDs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import PDO, NodePdo
from dvtcli.operations.switch import switch

if TYPE_CHECKING:
    from dvtcli.domain.pdo import PdoConfig
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session import Session

TASK = ("Change PDOs", 30)


@click.command("enable", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES)
@click.argument("pdos", type=PDO, nargs=-1, required=True, metavar="PDO...")
@click.pass_obj
def command(session: Session, /, pdos: tuple[NodePdo, ...]) -> Changed:
    """Enable each PDO with the mapping it has.

    \b
    enable tpdo1 tpdo2
    """
    return switch(session, pdos, _enabled)


def _enabled(now: PdoConfig) -> PdoConfig:
    parameter = now.communication
    return replace(now, communication=replace(parameter, cob_id=parameter.cob_id.enabled()))

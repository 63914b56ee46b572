"""Set communication parameters of a PDO: COB-ID, transmission type, inhibit time, event timer."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._pdo_options import pdo_options, request
from dvtcli.cli.pdo_params import PDO, NodePdo
from dvtcli.domain.request import MPDO_COUNTS, PdoRequest
from dvtcli.operations.changes.change import configure

if TYPE_CHECKING:
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session.session import Session


@click.command("set", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES)
@click.argument("pdo", type=PDO)
@pdo_options
@click.option("--mpdo", type=click.Choice(["sam", "dam"]),
              help="Make it a multiplexed PDO: SAM or DAM.")  # fmt: skip
@click.pass_obj
def command(session: Session, /, pdo: NodePdo, mpdo: str | None, **options: Any) -> Changed:
    """Set communication parameters of PDO; only --mpdo changes its mapping.

    \b
    set tpdo1 --timer 100             one write, the PDO stays enabled
    set tpdo2 --cob-id 0x201 --sync 1
    set tpdo3 --mpdo sam --event      multiplexed, by the scanner list (0x1FA0)
    """
    asked = replace(request(options, enabled=None), mpdo=None if mpdo is None else MPDO_COUNTS[mpdo])
    if asked == PdoRequest():
        raise click.UsageError("nothing to set: give an option such as --type, --timer or --cob-id")
    return configure(session, session.node(pdo.node_id), {pdo.pdo: asked})

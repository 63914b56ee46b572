"""Clear PDOs: no mapping, and disabled."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import PDO, CanopenType, NodePdo
from dvtcli.domain.pdo import PdoConfig
from dvtcli.errors import DvtcliError
from dvtcli.operations.switch import switch

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session import Session

TASK = ("Change PDOs", 50)


class PdoOrAll(CanopenType):
    """A PDO, or the word `all`."""

    name = "pdo"

    def parse(self, text: str, ctx: click.Context | None) -> NodePdo | None:
        """The PDO, or None for all of them."""
        return None if text.lower() == "all" else PDO.parse(text, ctx)


@click.command("clear", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES)
@click.argument("pdos", type=PdoOrAll(), nargs=-1, required=True, metavar="PDO...|all")
@click.pass_obj
def command(session: Session, /, pdos: tuple[NodePdo | None, ...]) -> Changed:
    """Disable each PDO and empty its mapping.

    \b
    clear tpdo3 rpdo3
    clear all          every PDO of the node whose mapping can be changed
    """
    if None not in pdos:
        return switch(session, [pdo for pdo in pdos if pdo is not None], cleared)
    return clear_all(session, session.node())


def clear_all(session: Session, node: Node) -> Changed:
    """Clear every PDO of *node* whose mapping can be changed; DvtcliError where there is none."""
    node.claim()
    dynamic = {pdo: config for pdo, config in node.pdos().items() if node.is_dynamic(pdo)}
    if not dynamic:
        raise DvtcliError(f"node {node.node_id} has no PDO whose mapping can be changed", node=node.node_id)
    wanted = [pdo for pdo, config in dynamic.items() if cleared(config) != config]
    return switch(session, [NodePdo(pdo, node.node_id) for pdo in wanted or dynamic], cleared)


def cleared(now: PdoConfig) -> PdoConfig:
    """*now* without a mapping, and disabled."""
    parameter = now.communication
    return PdoConfig(replace(parameter, cob_id=parameter.cob_id.disabled()), ())

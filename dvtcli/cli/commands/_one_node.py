"""PDOs of one line: they are changed all or none, so they are of one node."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from dvtcli.cli.pdo_params import NodePdo
    from dvtcli.domain.pdo import Pdo


def one_node(pdos: Iterable[NodePdo]) -> tuple[int | None, list[Pdo]]:
    """The node-ID that *pdos* share, None where they name none, and the PDOs; UsageError where they name several."""
    chosen = list(pdos)
    node_ids = {pdo.node_id for pdo in chosen}
    if len(node_ids) > 1:
        raise click.UsageError("PDOs of several nodes: use one line for each node")
    return node_ids.pop(), [pdo.pdo for pdo in chosen]

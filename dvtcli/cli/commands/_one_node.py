"""PDOs of one line must belong to one node, because they are changed all or none."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from dvtcli.cli.pdo_params import NodePdo
    from dvtcli.domain.pdo import Pdo


def one_node(pdos: Iterable[NodePdo]) -> tuple[int | None, list[Pdo]]:
    """Return the common node-ID of *pdos* (None if unnamed), and the PDOs.

    Raises UsageError if they name several nodes.
    """
    chosen = list(pdos)
    node_ids = {pdo.node_id for pdo in chosen}
    if len(node_ids) > 1:
        raise click.UsageError("PDOs of several nodes: use one line for each node")
    return node_ids.pop(), [pdo.pdo for pdo in chosen]

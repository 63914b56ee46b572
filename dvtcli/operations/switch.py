"""What `enable`, `disable` and `clear` share: one new configuration for each of several PDOs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import click

from dvtcli.operations.change import configure

if TYPE_CHECKING:
    from dvtcli.cli.params import NodePdo
    from dvtcli.domain.pdo import PdoConfig
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session import Session


def switch(session: Session, pdos: Iterable[NodePdo], make: Callable[[PdoConfig], PdoConfig]) -> Changed:
    """Change every one of *pdos* with *make*, all or none; they must be of one node."""
    chosen = list(pdos)
    node_ids = {pdo.node_id for pdo in chosen}
    if len(node_ids) > 1:
        raise click.UsageError("PDOs of several nodes: use one line for each node")
    node = session.node(node_ids.pop())
    return configure(session, node, {pdo.pdo: lambda proposal: make(proposal.now) for pdo in chosen})

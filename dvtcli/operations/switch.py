"""Enabling, disabling and clearing several PDOs of a node at once, all or none."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from dvtcli.domain.request import Cleared, cleared
from dvtcli.errors import DvtcliError
from dvtcli.operations.change import configure

if TYPE_CHECKING:
    from dvtcli.domain.pdo import Pdo
    from dvtcli.domain.request import PdoWant
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session import Session


def switch(session: Session, node_id: int | None, pdos: Iterable[Pdo], want: PdoWant) -> Changed:
    """Make every one of *pdos* of the node with *node_id* (None: the selected one) what *want* says, all or none."""
    return configure(session, session.node(node_id), dict.fromkeys(pdos, want))


def clear_all(session: Session, node_id: int | None = None) -> Changed:
    """Clear every PDO of a node whose mapping can be changed; DvtcliError where there is none."""
    node = session.node(node_id)
    node.claim()
    dynamic = {pdo: config for pdo, config in node.pdos().items() if node.is_dynamic(pdo)}
    if not dynamic:
        raise DvtcliError(f"node {node.node_id} has no PDO whose mapping can be changed", node=node.node_id)
    wanted = [pdo for pdo, config in dynamic.items() if cleared(config) != config]
    return configure(session, node, dict.fromkeys(wanted or dynamic, Cleared()))

"""The ends of a link as typed; a PDO without a node belongs to the selected node."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.cli.pdo_params import NodePdo
    from dvtcli.domain.network.wanted_state import Endpoint
    from dvtcli.operations.session.session_nodes import SessionNodes


def endpoints(session: SessionNodes, words: Iterable[NodePdo]) -> list[Endpoint]:
    """Return the PDOs of *words*, each with its node."""
    from dvtcli.domain.network.wanted_state import Endpoint

    return [Endpoint(session.node_id() if word.node_id is None else word.node_id, word.pdo) for word in words]

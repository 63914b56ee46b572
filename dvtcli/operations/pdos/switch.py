"""Enabling, disabling and clearing several PDOs of a node at once, all or none."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.proposal import proposal
from dvtcli.domain.profile import Severity
from dvtcli.domain.request import Cleared, cleared
from dvtcli.domain.rules import check_pdo, errors_in
from dvtcli.errors import DvtcliError
from dvtcli.operations.changes.change import configure

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.request import AnyPdoRequest
    from dvtcli.domain.rules import Finding
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session.session_nodes import SessionNodes


def switch(session: SessionNodes, node_id: int | None, pdos: Iterable[Pdo], want: AnyPdoRequest) -> Changed:
    """Configure all *pdos* of the node with *node_id* (None: the selected node) by *want*, all or none."""
    return configure(session, session.node(node_id), dict.fromkeys(pdos, want))


def clear_all(session: SessionNodes, node_id: int | None = None) -> Changed:
    """Clear every PDO of a node with a changeable mapping, all or none; raises DvtcliError if there are none.

    PDOs that the rules do not let be cleared stay, and are reported.
    """
    node = session.node(node_id)
    found = node.begin_change()
    dynamic = {pdo: config for pdo, config in node.known_pdos().items() if node.is_dynamic(pdo)}
    if not dynamic:
        raise DvtcliError(f"node {node.node_id} has no PDO whose mapping can be changed", node=node.node_id)
    wanted = [pdo for pdo, config in dynamic.items() if cleared(config) != config] or list(dynamic)
    refused = {} if session.options.force else _refused(node, {pdo: dynamic[pdo] for pdo in wanted})
    rest = [pdo for pdo in wanted if pdo not in refused] or wanted
    done = configure(session, node, dict.fromkeys(rest, Cleared()), found)
    left = (finding for pdo, finding in refused.items() if pdo not in rest)
    return replace(done, findings=(*done.findings, *left))


def _refused(node: ReadableNode, held: Mapping[Pdo, PdoConfig]) -> dict[Pdo, Finding]:
    """Return the PDOs of *held* that must not be cleared, with reasons."""
    found: dict[Pdo, Finding] = {}
    for pdo, config in held.items():
        errors = errors_in(check_pdo(proposal(node, pdo, config, cleared(config))))
        if errors:
            text = f"{pdo.label} is not changed and may be enabled: {errors[0].text}"
            found[pdo] = replace(errors[0], severity=Severity.WARNING, text=text, abort=None, hint=None)
    return found

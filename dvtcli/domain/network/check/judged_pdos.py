"""What `map` would say of the PDOs that a node holds. Decides nothing itself, and asks no device."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.lint.map_judgement import blank
from dvtcli.domain.network.network_state import EMCY_COB_ID, SYNC_COB_ID, NodeState
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.rules import Finding, Proposal, check_pdo
from dvtcli.domain.services import taken_by_services


def judged_pdos(node: NodeState) -> Iterator[tuple[Pdo, Finding]]:
    """Tell what `map` would say of each PDO that is enabled, or that a file names, made one after the other."""
    before: dict[Pdo, PdoConfig] = {}
    emcy = node.number(EMCY_COB_ID)
    for pdo, config in sorted(node.pdos.items()):
        if (not config.enabled and pdo not in node.marks) or config.inconsistency or config.mpdo is not None:
            continue
        proposal = Proposal(
            node.node_id, pdo, blank(config), config, before, node.profile, node.dictionary,
            services=lambda: taken_by_services(node.node_id, node.number(SYNC_COB_ID), emcy, node.sdo_channels),
        )  # fmt: skip
        yield from ((pdo, finding) for finding in check_pdo(proposal))
        before = {**before, pdo: config}

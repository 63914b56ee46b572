"""Consent to a reset: an enabled drive releases its motor when it is reset."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.operations.session.session_nodes import SessionNodes


def consent_to_reset(session: SessionNodes, node_ids: Collection[int]) -> None:
    """Ask before a reset of *node_ids* if a node may be an enabled drive; raises SafetyRefusal on no.

    A simulated drive boots as in its EDS, perhaps enabled: it counts only after a command of this session.
    """
    if session.options.yes or session.dry_run:
        return
    for node_id, why in _may_move(session, node_ids).items():
        session.consent(f"node {node_id} {why}: its reset lets a motor go; reset?", node_id)


def refuse_reset(session: SessionNodes, node_ids: Collection[int]) -> None:
    """Raises SafetyRefusal if one of *node_ids* may be an enabled drive, even under --yes."""
    for node_id, why in _may_move(session, node_ids).items():
        raise SafetyRefusal(
            f"node {node_id} {why}: its reset lets a motor go",
            node=node_id,
            hint=Hint(
                Action.GIVE, {"prove": True}, "bring the machine to a stand, then 6040 = 6; without {} no node is reset"
            ),
        )


def _may_move(session: SessionNodes, node_ids: Collection[int]) -> dict[int, str]:
    """Map those of *node_ids* that may be enabled drives to the reason."""
    from dvtcli.device.seen_state import why_it_may_move

    if session.bus.simulated:
        node_ids = [node_id for node_id in node_ids if commanded(session, node_id)]
    said = {node_id: why_it_may_move(session.bus, node_id) for node_id in sorted(node_ids)}
    return {node_id: why for node_id, why in said.items() if why}


def consent_to_reset_unheard(session: SessionNodes) -> None:
    """Ask before a reset of all nodes if none is known: whether a drive moves is unknown."""
    if not session.bus.simulated:
        session.consent("no node is seen, a drive whose operation is enabled may be there all the same; reset all?")


def commanded(session: SessionNodes, node_id: int) -> bool:
    """Tell whether this session wrote a controlword of the node."""
    from dvtcli.device.seen_state import CONTROLWORDS

    node = session.network.nodes.get(node_id)
    return node is not None and not CONTROLWORDS.isdisjoint(node.wanted_values)

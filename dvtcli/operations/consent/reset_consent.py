"""Consent to a reset: a drive whose operation is enabled lets go of its motor when it is reset."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.operations.session.session import Session


def consent_to_reset(session: Session, node_ids: Collection[int]) -> None:
    """Ask before *node_ids* are reset where one may be a drive whose operation is enabled; SafetyRefusal on no.

    A drive of this process comes up as its EDS says, which may be enabled: it counts once this session commanded it.
    """
    if session.options.yes or session.dry_run:
        return
    for node_id, why in _may_move(session, node_ids).items():
        session.consent(f"node {node_id} {why}: its reset lets a motor go; reset?", node_id)


def refuse_reset(session: Session, node_ids: Collection[int]) -> None:
    """SafetyRefusal where one of *node_ids* may be a drive whose operation is enabled, also where all is agreed to."""
    for node_id, why in _may_move(session, node_ids).items():
        raise SafetyRefusal(
            f"node {node_id} {why}: its reset lets a motor go",
            node=node_id,
            hint=Hint(
                Action.GIVE, {"prove": True}, "bring the machine to a stand, then 6040 = 6; without {} no node is reset"
            ),
        )


def _may_move(session: Session, node_ids: Collection[int]) -> dict[int, str]:
    """Those of *node_ids* that may be such drives, and why."""
    from dvtcli.device.seen_state import why_it_may_move

    if session.bus.simulated:
        node_ids = [node_id for node_id in node_ids if commanded(session, node_id)]
    said = {node_id: why_it_may_move(session.bus, node_id) for node_id in sorted(node_ids)}
    return {node_id: why for node_id, why in said.items() if why}


def consent_to_reset_unheard(session: Session) -> None:
    """Ask before all nodes of a bus are reset on which none is heard: whether a drive moves is not known."""
    if not session.bus.simulated:
        session.consent("no node is heard, a drive whose operation is enabled may be there all the same; reset all?")


def commanded(session: Session, node_id: int) -> bool:
    """Whether this session wrote a controlword of the node."""
    from dvtcli.device.seen_state import CONTROLWORDS

    node = session.network.nodes.get(node_id)
    return node is not None and not CONTROLWORDS.isdisjoint(node.wanted_values)

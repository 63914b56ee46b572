"""Consent to a reset: a drive whose operation is enabled lets go of its motor when it is reset."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.operations.session import Session


def consent_to_reset(session: Session, node_ids: Collection[int]) -> None:
    """Ask before *node_ids* are reset where a drive among them says "operation enabled"; SafetyRefusal on no.

    Not of nodes that live in this process only: they have no motor.
    """
    from dvtcli.device.seen_state import moving

    if session.options.yes or session.dry_run or session.bus.simulated:
        return
    for node_id, statusword in moving(session.bus, sorted(node_ids)).items():
        session.consent(
            f"node {node_id} says operation enabled (0x6041 is 0x{statusword:04X}): its reset lets the motor go; reset?"
        )

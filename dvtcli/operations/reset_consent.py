"""Consent to a reset: a drive whose operation is enabled lets go of its motor when it is reset."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.operations.session import Session


def consent_to_reset(session: Session, node_ids: Collection[int]) -> None:
    """Ask before *node_ids* are reset where a drive among them says "operation enabled"; SafetyRefusal on no."""
    from dvtcli.device.seen_state import moving

    if session.options.yes or session.dry_run:
        return
    for node_id, (index, statusword) in moving(session.bus, sorted(node_ids)).items():
        said = f"0x{index:04X} is 0x{statusword:04X}"
        session.consent(f"node {node_id} says operation enabled ({said}): its reset lets the motor go; reset?")

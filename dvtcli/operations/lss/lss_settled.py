"""Nodes of a file that have their node-IDs already, for whoever lets them keep these by LSS. Changes nothing.

A node does not tell what it has stored: what it has may be lost with the power.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from dvtcli.device.lss_master import LssMaster
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.lss_services import PARTS, LssAddress
from dvtcli.domain.several import join_some
from dvtcli.errors import NoAnswer, SafetyRefusal
from dvtcli.operations.lss.lss_find import selected
from dvtcli.operations.lss.lss_node_id import told_id
from dvtcli.operations.results.lss_nodes import LssGiven

if TYPE_CHECKING:
    from dvtcli.domain.network.wanted_state import NodeWish
    from dvtcli.operations.lss.lss_identity import Identity
    from dvtcli.operations.session.session import Session


def to_store(
    session: Session, master: LssMaster, settled: Sequence[NodeWish], there: Mapping[int, Identity | None]
) -> list[LssGiven]:
    """Those of *settled* that can be told to store; the others, which LSS does not reach, are named in a warning.

    *there* is what 0x1018 of each node-ID says. DeviceRefused where several nodes have one address, SafetyRefusal where
    a node has another node-ID by LSS than by SDO.
    """
    kept: list[LssGiven] = []
    out_of_reach: list[str] = []
    for wish in settled:
        told = [part for part in there.get(wish.node_id) or () if part is not None]
        one = LssGiven(LssAddress(*told), wish.node_id, wish.node_id, name=wish.name) if len(told) == PARTS else None
        if one is not None and _takes_part(master, one):
            kept.append(one)
        else:
            out_of_reach.append(f"{wish.name} ({wish.node_id})")
    master.let_wait()
    if out_of_reach:
        session.tell.warning(
            f"not told to store, since LSS does not reach them: {join_some(out_of_reach)}; "
            "whether they keep their node-IDs is set in their makers' ways"
        )
    return kept


def _takes_part(master: LssMaster, one: LssGiven) -> bool:
    try:
        now = selected(master, one.address)
    except NoAnswer:
        return False
    require_same(one, now)
    return True


def require_same(one: LssGiven, now: int) -> None:
    """SafetyRefusal where a node says by LSS (*now*) that it has another node-ID than by SDO."""
    if now != one.before:
        raise SafetyRefusal(
            f"{one.name} says by LSS that its node-ID is {told_id(now)}, and by SDO {told_id(one.before)}",
            why=str(one.address),
            hint=Hint(Action.RESET_COMMUNICATION, why="a node-ID that was given waits for a reset: {}"),
        )

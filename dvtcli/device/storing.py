"""Checks before a store, and records after a store or restore."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from dvtcli.device.access_level import level_finding
from dvtcli.device.applied import refuse
from dvtcli.device.change.change_guard import who_else
from dvtcli.device.change.pending import CHANGE
from dvtcli.device.unstored import held_unstored
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.device.change.changeable import Changeable


def prepare_store(node: Changeable, *, force: bool = False, confirm: bool = True) -> None:
    """Prepare a store or restore: check as `require_storable`, and enter the gate if needed."""
    require_storable(node, force=force, confirm=confirm)
    if node.profile.store.only_pre_operational:
        node.gate.enter()


def _ways_out(node_id: int, *, confirm: bool) -> Hint:
    reset = Hint(Action.RESET_NODE, {"node": node_id}, "{} brings back what is stored")
    reset += Hint(Action.STORE if confirm else Action.RESTORE, why="then {}")
    return Hint(Action.VERIFY, why="set it as it should be and {}, or") + reset if confirm else reset


def require_storable(node: Changeable, *, force: bool = False, confirm: bool = True) -> None:
    """Raise SafetyRefusal if values to store are not as expected, RuleError if a login is required.

    Reads this session's changes and all PDOs again, since a device may have lost or altered them; not without
    *confirm*, for a caller about to discard them all.
    """
    node.begin_change()
    word = "stored" if confirm else "restored"
    for cause, reason in node.pending.suspicions.items():
        if confirm or cause == CHANGE:
            raise SafetyRefusal(
                f"node {node.node_id} is not {word}: {reason}",
                node=node.node_id,
                hint=_ways_out(node.node_id, confirm=confirm),
            )
    refuse(level_finding(node.access), "nothing was stored or restored", node.node_id, force=force)
    if confirm and not force:
        node.expected.require(node, who_else(node.keeper))
    if confirm and node.keeper is not None:
        node.storing = node.identity()  # no request after the store is needed
        node.pending.of_others(held_unstored(node, node.keeper.past, node.storing))


def mark_stored(node: Changeable, labels: Iterable[str]) -> None:
    """Mark *labels* as stored: no later process lists them as unstored."""
    if node.keeper is not None:
        node.keeper.past.was_stored(node.node_id, node.storing, set(labels))

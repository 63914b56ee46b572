"""Before and after a store or restore: what must not be stored, and what need not be named any more. Sends neither."""

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
    """Before a store or restore: as `require_storable`; enter the gate where needed."""
    require_storable(node, force=force, confirm=confirm)
    if node.profile.store.only_pre_operational:
        node.gate.enter()


def _ways_out(node_id: int, *, confirm: bool) -> Hint:
    reset = Hint(Action.RESET_NODE, {"node": node_id}, "{} brings back what is stored")
    reset += Hint(Action.STORE if confirm else Action.RESTORE, why="then {}")
    return Hint(Action.VERIFY, why="set it as it should be and {}, or") + reset if confirm else reset


def require_storable(node: Changeable, *, force: bool = False, confirm: bool = True) -> None:
    """Let nothing be stored that is not as it should be: SafetyRefusal, RuleError where nobody is logged in.

    What this session changed is read again, and the PDOs whole, since a device may have lost or altered them;
    *confirm* says whether: not where all of it is about to be given up, nor does it matter then that it is lost or
    altered already.
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
        node.storing = node.identity()  # once it has stored nothing more is asked for that
        node.pending.of_others(held_unstored(node, node.keeper.past, node.storing))


def mark_stored(node: Changeable, labels: Iterable[str]) -> None:
    """A store took what the node held of *labels*: no later process names them again."""
    if node.keeper is not None:
        node.keeper.past.was_stored(node.node_id, node.storing, set(labels))

"""Changes present in a node but not stored, checks before a store, and records after a store or restore."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from dvtcli.device.access_level import level_finding
from dvtcli.device.change.applied import refuse
from dvtcli.device.store.pending import CHANGE
from dvtcli.device.target_config import differences, value_differences
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.plan import PdoChange, alters
from dvtcli.errors import InputFileError, SafetyRefusal, SdoAborted, UsageError

if TYPE_CHECKING:
    from dvtcli.device.change.applied import Applied
    from dvtcli.device.change.change_history import ChangeHistory
    from dvtcli.device.change.changeable import Changeable
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.plan import Change, Plan


def held_unstored(node: ReadableNode, history: ChangeHistory, identity: Identity) -> Mapping[str, int]:
    """Labels of changes present in *node* and not known to be stored, each with its index.

    *history* is the history of the device with this *identity* (0x1018). Reads the node, to exclude changes lost by a
    restart or replaced by others. Empty if the file is damaged; the next change reports the damage.
    """
    return {
        label: change.steps[0].index
        for label, change in last_unstored(node, history, identity).items()
        if _is_held(node, change)
    }


def is_remembered(node: ReadableNode, history: ChangeHistory) -> bool:
    """True if *history* has a change of *node* not known to be stored; does not read the PDOs or objects."""
    return bool(last_unstored(node, history, node.identity()))


def last_unstored(node: NodeDescription, history: ChangeHistory, identity: Identity) -> dict[str, Change]:
    """The last recorded change of each PDO and object, if not stored; oldest first."""
    try:
        entries = history.all_of(node.node_id, identity)
    except InputFileError:
        return {}
    last: dict[str, Change | None] = {}
    for entry in entries:
        for change in entry.plan.changes:
            if alters(change) and node.profile.store.needed_for(change.steps[0].index):
                last.pop(change.label, None)
                last[change.label] = None if change.label in entry.stored else change
    return {label: change for label, change in last.items() if change is not None}


def _is_held(node: ReadableNode, change: Change) -> bool:
    with suppress(SdoAborted, UsageError):  # what cannot be read is not claimed
        if isinstance(change, PdoChange):
            return not list(differences(change.pdo, change.after, node.pdo(change.pdo)))
        place = change.step.index, change.step.sub_index
        return change.step.before is not None and not list(value_differences(node, {place: change.step.after}))
    return False


def may_be_unstored(node: Changeable, history: Sequence[Plan], labels: Iterable[str]) -> set[str]:
    """The labels of changes by dvtcli that *node* may not have stored; *history* are the changes of this session.

    All *labels* if the stored values are no state of this session, as after a partial store.
    """
    pending, wanted = node.pending, set(labels)
    if pending.partly_stored or len(history) < pending.stored_at:
        return wanted
    since = history[max(pending.stored_at, pending.lost_until) :]
    unstored = {change.label for plan in since for change in plan.changes if alters(change)}
    if node.guard is not None:
        unstored |= last_unstored(node, node.guard.history, node.identity()).keys()
    return wanted & unstored


def mark_restored(node: Changeable, history: Sequence[Plan], applied: Applied) -> None:
    """Drop the unstored changes that the undo *applied* returned to the stored values; *history* as above."""
    if applied.findings or applied.not_put_back or applied.unrestored:
        return
    labels = {change.label for change in applied.plan.changes}
    for label in labels - may_be_unstored(node, history, labels):
        node.pending.unstored.pop(label, None)


def prepare_store(node: Changeable, *, force: bool = False, confirm: bool = True) -> None:
    """Prepare a store or restore: check as `require_storable`, and enter the gate if needed."""
    require_storable(node, force=force, confirm=confirm)
    if node.profile.store.only_pre_operational:
        node.gate.enter()


def _ways_out(node_id: int, *, confirm: bool) -> Hint:
    reset = Hint(Action.RESET_NODE, {"node": node_id}, "{} restores the stored values")
    reset += Hint(Action.STORE if confirm else Action.RESTORE, why="then {}")
    if not confirm:
        return reset
    return Hint(Action.VERIFY, why="set the lost values again and check with {}, then store; or reset instead") + reset


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
        from dvtcli.device.change.change_guard import who_else

        node.expected.require(node, who_else(node.guard))
    if confirm and node.guard is not None:
        node.storing_identity = node.identity()  # no request after the store is needed
        node.pending.of_others(held_unstored(node, node.guard.history, node.storing_identity))


def mark_stored(node: Changeable, labels: Iterable[str]) -> None:
    """Mark *labels* as stored: no later process lists them as unstored."""
    if node.guard is not None:
        node.guard.history.was_stored(node.node_id, node.storing_identity, set(labels))

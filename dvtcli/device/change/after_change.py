"""After a change or a failure: restore the NMT state, close the journal, complete the error message."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from dvtcli.device.change.failed_change import brought_back_first, left_changed, pre_operational_first
from dvtcli.device.change.pending import CHANGE
from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.plan import Plan
from dvtcli.domain.text import join_some
from dvtcli.errors import DvtcliError, JournalKept, LeftChanged

if TYPE_CHECKING:
    from dvtcli.device.change.changeable import Changeable
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.rules import Finding

#: How long a heartbeat is waited for that tells whether a node restarted without a boot-up message, in seconds.
HEARTBEAT_S = 1.2


def restarted_since(node: ReadableNode, found: InitialState) -> bool:
    """True if *node* may have restarted since *found*: a boot-up was received or an upload was repeated."""
    return node.bus.upsets(node.node_id) != found.upsets


def left_open(node: Changeable, left: LeftChanged) -> None:
    """After a failed roll-back: block stores, and add to *left* how to finish."""
    node.pending.suspicions[CHANGE] = left.text
    node.mark_unknown()
    if node.keeper is not None:
        left.place = str(node.keeper.own_journal.path)
        finish = Hint(Action.RECOVER, why=f"finishes it, from {verbatim(left.place)}")
        left.hint = finish.after(brought_back_first(left.hint))


def end_change(node: Changeable, plan: Plan, back: Callable[[], None], *, keep_journal: bool) -> None:
    """Complete the change: bring the node *back* to its NMT state and remove the journal."""
    try:
        back()
    except KeyboardInterrupt as torn:
        left = left_changed(plan, torn, torn)
        left.text, left.why = f"stopped before {labels_of(plan)} of node {plan.node_id} was complete", None
        left.state_text = f"LEFT CHANGED: {set_words(plan)}; it is not complete without its NMT state"
        left_open(node, left)
        raise left from torn
    except DvtcliError as failed:  # the node may have restarted since the read-back
        failed.state = "unknown"
        failed.state_text = f"unknown: {set_words(plan)} before that; look at the node"
        if not keep_journal:
            _close(node, failed)
        raise
    if not keep_journal:
        _close(node)


def set_words(plan: Plan) -> str:
    """The result of a completed *plan* in words: verified values, and values that cannot be read back."""
    blind = [change.label for change in plan.unreadable]
    read = [change.label for change in plan.changes if change.label not in blind]
    said = [f"{join_some(read)} was set and read back equal"] if read else []
    return ", ".join([*said, *([f"{join_some(blind)} was written, which cannot be read back"] if blind else [])])


def labels_of(plan: Plan) -> str:
    """A short text of the changes in *plan*."""
    return join_some(change.label for change in plan.changes)


def _close(node: Changeable, error: BaseException | None = None) -> None:
    """Remove the journal. If removal fails, adds a note to *error*, or raises JournalKept without an error."""
    if node.keeper is None:
        return
    try:
        node.keeper.own_journal.end()
    except JournalKept as kept:
        if error is None:
            raise
        if isinstance(error, DvtcliError):
            error.details.append(("journal", f"{kept.text}: {kept.why}; {kept.hint}"))


def restore_nmt_state(node: Changeable, error: BaseException, found: InitialState) -> None:
    """Close the journal of a rolled-back change; failures to restore the NMT state are added to *error*."""
    try:
        return_to_state(node, found)
        unseen = found.state is None and _rebooted(node, found)
    except DvtcliError as failed:
        _add(error, f"{failed.text}: {failed.why or failed.hint}")
    except KeyboardInterrupt:
        _add(error, f"stopped once more: look at the NMT state of node {node.node_id}")
    else:
        if unseen:
            _add(error, f"node {node.node_id} restarted; its NMT state before is not known: look at it")
    _close(node, error)


def _add(error: BaseException, text: str) -> None:
    if isinstance(error, DvtcliError):
        error.details.append(("nmt", text))


def explain_refusal(node: Changeable, error: DvtcliError, findings: tuple[Finding, ...]) -> None:
    """Add to *error* why the device refused and what to do, from *findings*, the maker's hints and the NMT state."""
    if error.abort is not None:  # what the rules said explains a refusal, not a silence
        foreseen = (finding.text for finding in findings if finding.place == f"0x{error.place}")
        error.why = error.why or next(foreseen, None)
    error.hint = error.hint or _hint(node, error) or _hint_of_state(node, error)
    if error.abort in node.profile.store.never_after:
        node.pending.suspicions[CHANGE] = f"the device answered 0x{error.abort:08X} to a change"


def _hint(node: NodeDescription, error: DvtcliError) -> str | None:
    """The maker's hint for a refusal at this step."""
    if error.abort is None or error.place is None or ":" not in error.place:
        return None
    index, sub_index = (int(number, 16) for number in error.place.split(":"))
    return node.profile.hint(index, sub_index, error.abort)


def _hint_of_state(node: ReadableNode, error: DvtcliError) -> Hint | None:
    """What to try if a running device refuses for a reason of its own or for its state."""
    if error.abort not in (Abort.GENERAL, Abort.DEVICE_STATE):
        return None
    running = node.bus.nmt_state(node.node_id) is NmtState.OPERATIONAL
    return pre_operational_first(node.node_id) if running else None


def _rebooted(node: ReadableNode, found: InitialState) -> bool:
    return node.bus.boot_ups(node.node_id) != found.boot_ups


def return_to_state(node: Changeable, found: InitialState) -> None:
    """Restore the NMT state after a reboot; inside an open gate the gate's end restores the state.

    A node that restarts without a boot-up message leaves an upload unanswered and reports another NMT state.
    """
    if found.state is not NmtState.OPERATIONAL or node.gate.entered:
        return
    rebooted = _rebooted(node, found)
    unsure = not rebooted and restarted_since(node, found)
    if rebooted or (unsure and node.access.state(HEARTBEAT_S) is NmtState.PRE_OPERATIONAL):
        node.access.insist(NmtState.OPERATIONAL)

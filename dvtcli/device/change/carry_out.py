"""Carrying out a plan on a node: gate, lock, backup, journal, transaction, and the NMT state afterwards.

Decides nothing about what is legal, and shows nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import count
from typing import TYPE_CHECKING

from dvtcli.device.change.failed_change import BRING_BACK, BUS_BACK, TRY_AGAIN, left_changed
from dvtcli.device.change.other_pdos import OtherPdos, cob_ids_beside, is_of_pdo, wholes_beside
from dvtcli.device.change.pending import CHANGE
from dvtcli.device.change.progress import Progress
from dvtcli.device.change.put_back import first_difference
from dvtcli.device.change.transaction import Transaction
from dvtcli.domain.abort import Abort
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.plan import Change, Plan, Step
from dvtcli.domain.several import several
from dvtcli.errors import DvtcliError, JournalKept, LeftChanged, Restarted

if TYPE_CHECKING:
    from dvtcli.device.change.changeable import Changeable
    from dvtcli.device.observe import Found
    from dvtcli.domain.rules import Finding

#: How long a heartbeat is waited for that tells whether a node restarted without a boot-up message, in seconds.
HEARTBEAT_S = 1.2


def carry_out(
    node: Changeable,
    plan: Plan,
    findings: tuple[Finding, ...] = (),
    *,
    found: Found | None = None,
    done: Callable[[int], None] = lambda _boot_ups: None,
    keep_journal: bool = False,
) -> None:
    """As below, from its first to its last file and frame: a signal waits for a safe point, or comes too late.

    *found* is how the node was claimed when the plan was made, None where that is done now. With *keep_journal* the
    journal of a change that stands is left open: who asked for it puts the change back.
    """
    with node.cancellation.guard():
        found = node.claim() if found is None else found
        _carry_out(node, plan, findings, found, done, keep_journal=keep_journal)
    node.cancellation.hold()


def _carry_out(
    node: Changeable,
    plan: Plan,
    findings: tuple[Finding, ...],
    found: Found,
    done: Callable[[int], None],
    *,
    keep_journal: bool,
) -> None:
    """Take *node* to where *plan* ends, or leave it as it was; LeftChanged names the journal where neither works.

    *findings* are what the rules had said; they explain a refusal of something that was forced. *done* is called once
    the plan was read back, before anything else can go wrong, with the number of boot-ups seen by then.
    """
    is_watched = _is_watched(node, plan)
    if is_watched:
        node.known_pdos()
    cob_ids = cob_ids_beside(node, plan)
    if node.keeper is not None:
        node.keeper.begin(plan, node.identity(), found.state, node.known_pdos, node.last_read)
    try:
        beside = wholes_beside(node, plan, found)
        untold = any(config.lacking for config in node.last_read.values())
        enter(node, found)
        boot_ups = run(node, plan, OtherPdos(cob_ids, beside))
    except LeftChanged as left:
        left_open(node, left)
        raise
    except BaseException as error:
        if isinstance(error, DvtcliError):
            _explain(node, error, findings)
        _settle_after(node, error, found)
        raise
    node.expected.seen(beside, whole=is_watched and not untold)
    if node.keeper is not None:
        node.keeper.own_journal.carried_out()
    done(boot_ups)
    _end(node, plan, lambda: _return(node, found), keep_journal=keep_journal)


def enter(node: Changeable, found: Found) -> None:
    """Make PDO writes possible; a node that restarted since it was *found* OPERATIONAL goes back there at the end."""
    was_in = node.gate.entered
    node.gate.enter()
    if not was_in and node.gate.entered and node.gate.found is None and restarted_since(node, found):
        node.gate.found = found.state


def restarted_since(node: Changeable, found: Found) -> bool:
    """Whether *node* may have restarted since it was *found*: its boot-up was heard, or an upload was repeated."""
    return node.bus.upsets(node.node_id) != found.upsets


def look_again(node: Changeable, plan: Plan, found: Found) -> None:
    """Nothing of *plan* is to be written, and *node* may have restarted since it was *found*: is that still so?

    Restarted where it holds something else by now. It is brought back to the NMT state in which it was found.
    """
    differences = node.observed(lambda: [first_difference(node.sdo, change) for change in plan.changes])
    _return(node, found)
    difference = next(filter(None, differences), None)
    if difference is not None:
        raise Restarted(
            f"node {node.node_id} restarted while it was looked at: {_labels(plan)} is not as wanted any more",
            node=node.node_id,
            why=difference,
            hint=TRY_AGAIN,
        )


def _is_watched(node: Changeable, plan: Plan) -> bool:
    """Whether what *node* holds beside *plan* is to be read whole, for a store of this process to compare.

    After the only change of a program that makes one nothing is stored: no uploads are spent on that.
    """
    return is_of_pdo(plan) and not node.only_one() and not node.expected.is_whole


def left_open(node: Changeable, left: LeftChanged) -> None:
    """A roll-back failed: nothing may be stored, and *left* says how to finish."""
    node.pending.suspicions[CHANGE] = left.text
    node.is_unknown_now()
    if node.keeper is not None:
        left.place = str(node.keeper.own_journal.path)
        found = next((first for first in (BRING_BACK, BUS_BACK) if (left.hint or "").startswith(first)), None)
        first = f"{found}; then `recover`" if found else "recover"
        left.hint = f"{first} finishes it, from {left.place}"


def _end(node: Changeable, plan: Plan, back: Callable[[], None], *, keep_journal: bool) -> None:
    """The change is complete: bring the node *back* to its NMT state, and forget the journal."""
    try:
        back()
    except KeyboardInterrupt as torn:
        left = left_changed(plan, torn, torn)
        left.text, left.why = f"stopped before {_labels(plan)} of node {plan.node_id} was complete", None
        left_open(node, left)
        raise left from torn
    except DvtcliError as failed:  # it may have restarted since it was read back
        failed.state = "unknown"
        failed.state_text = f"unknown: {_labels(plan)} was set and read back equal before that; look at the node"
        if not keep_journal:
            _close(node, failed)
        raise
    if not keep_journal:
        _close(node)


def _labels(plan: Plan) -> str:
    return several(change.label for change in plan.changes)


def _close(node: Changeable, error: BaseException | None = None) -> None:
    """Forget the journal; where that fails, *error* is told of it, or JournalKept is raised where there is none."""
    if node.keeper is None:
        return
    try:
        node.keeper.own_journal.end()
    except JournalKept as kept:
        if error is None:
            raise
        if isinstance(error, DvtcliError):
            error.details.append(("journal", f"{kept.text}: {kept.why}; {kept.hint}"))


def _settle_after(node: Changeable, error: BaseException, found: Found) -> None:
    """The device is as it was: forget the journal; what cannot be put right of its NMT state is added to *error*."""
    try:
        _return(node, found)
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


def run(node: Changeable, plan: Plan, others: OtherPdos) -> int:
    """Run *plan* as one transaction, with an eye on the COB-IDs of *others*.

    What was read of the node before counts no longer. Returns the number of boot-ups that were seen when the read-back
    began.
    """

    def note(changes: Sequence[Change]) -> None:
        if node.keeper is not None:
            node.keeper.own_journal.note(Plan(plan.node_id, tuple(changes)))

    steps, total = count(1), len(plan)

    def took(step: Step) -> None:
        node.on_step(Progress(plan.node_id, next(steps), total, step))

    transaction = Transaction(
        node.sdo,
        plan,
        node.cancellation,
        node.access.explain,
        before_retry=node.gate.renew,
        clock=node.bus,
        witness=node.witness,
        others=others,
        on_altered=note,
        on_step=took,
    )
    try:
        transaction.run()
    finally:
        node.forget()
    return transaction.boot_ups_verified


def _explain(node: Changeable, error: DvtcliError, findings: tuple[Finding, ...]) -> None:
    if error.abort is not None:  # what the rules said explains a refusal, not a silence
        foreseen = (finding.text for finding in findings if finding.place == f"0x{error.place}")
        error.why = error.why or next(foreseen, None)
    error.hint = error.hint or _hint(node, error) or _hint_of_state(node, error)
    if error.abort in node.profile.store.never_after:
        node.pending.suspicions[CHANGE] = f"the device answered 0x{error.abort:08X} to a change"


def _hint(node: Changeable, error: DvtcliError) -> str | None:
    """What the family's maker says of this refusal at this step."""
    if error.abort is None or error.place is None or ":" not in error.place:
        return None
    index, sub_index = (int(number, 16) for number in error.place.split(":"))
    return node.profile.hint(index, sub_index, error.abort)


def _hint_of_state(node: Changeable, error: DvtcliError) -> str | None:
    """What to try where the device refuses for a reason of its own, or its state, and runs."""
    if error.abort not in (Abort.GENERAL, Abort.DEVICE_STATE):
        return None
    running = node.bus.nmt_state(node.node_id) is NmtState.OPERATIONAL
    return f"it is OPERATIONAL: `nmt preop {node.node_id}`, then again" if running else None


def _rebooted(node: Changeable, found: Found) -> bool:
    return node.bus.boot_ups(node.node_id) != found.boot_ups


def _return(node: Changeable, found: Found) -> None:
    """Undo what a reboot did to the NMT state, which inside an open gate is left to the gate's end.

    A node that restarts without a boot-up message leaves an upload without an answer, and tells another NMT state.
    """
    if found.state is not NmtState.OPERATIONAL or node.gate.entered:
        return
    rebooted = _rebooted(node, found)
    unsure = not rebooted and restarted_since(node, found)
    if rebooted or (unsure and node.access.state(HEARTBEAT_S) is NmtState.PRE_OPERATIONAL):
        node.access.insist(NmtState.OPERATIONAL)

"""After a change or a failure: restore the NMT state, close the journal, and report the values that differ."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.change.roll_back import differing_values
from dvtcli.device.observe import MAX_READS, RebootMonitor
from dvtcli.device.read_pdos import read_pdo
from dvtcli.device.store.pending import CHANGE
from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, ValueChange, plan_pdo
from dvtcli.domain.text import hex_preview, join_some, value_text
from dvtcli.errors import (
    BusUnavailable,
    DeviceRefused,
    DvtcliError,
    JournalKept,
    LeftChanged,
    LeftObject,
    NoAnswer,
    SdoAborted,
)

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.device.change.changeable import Changeable
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.ports import SdoReader
    from dvtcli.domain.rules.finding import Finding

#: What to do about a node that restarts.
TRY_AGAIN = "check its supply, then try again"
#: What to do first about one that does not answer, and about a bus that failed.
BRING_BACK = Hint(Action.FIND_NODES, why="bring the node back first (power, wiring, {})")
BUS_BACK = Hint(Action.CHECK_SETUP, why="restore the bus first ({} checks it)")


def brought_back_first(hint: Hint | str | None) -> Hint | None:
    """The part of *hint* about bringing the node or the bus back, to be done first; None without such a part."""
    known = (BRING_BACK, BUS_BACK)
    return next((first for first in known if isinstance(hint, Hint) and hint.begins_with(first)), None)


def pre_operational_first(node_id: int) -> Hint:
    """The hint to enter PRE-OPERATIONAL first, as node *node_id* is OPERATIONAL."""
    return Hint(Action.ENTER_PRE_OPERATIONAL, {"node": node_id}, "it is OPERATIONAL: {}, then again")


def step_line(step: Step) -> str:
    """A step for display: `0x1A00:03 <- 0x27030120  map 2703:01/32`."""
    value = (
        f"0x{int.from_bytes(step.after, 'little'):0{2 * len(step.after)}X}"
        if len(step.after) <= 4
        else hex_preview(step.after)
    )
    return f"0x{step.object} <- {value}    {step.reason}"


def refused(aborted: SdoAborted, step: Step, node_id: int, what: str) -> DeviceRefused:
    """The error for a refused *step*, with all details of the abort."""
    error = DeviceRefused(
        f"node {node_id} refused {what}",
        node=node_id,
        place=step.object,
        abort=aborted.code,
        why=aborted.why,
        hint=aborted.hint,
    )
    error.details.append(("step", step_line(step)))
    return error


def _reason(error: BaseException) -> str:
    return f" ({error.why})" if isinstance(error, DvtcliError) and error.why else ""


def left_changed(plan: Plan, fault: BaseException, second: BaseException) -> LeftChanged:
    """The error for a failed change with a failed roll-back: both causes and the values possibly left in the device."""
    labels = join_some(change.label for change in plan.changes)
    look = Hint(Action.SHOW_PDOS, {"all": True}, "check it with {}; a power cycle brings the stored settings back")
    if isinstance(second, NoAnswer | BusUnavailable):
        look = look.after(BRING_BACK if isinstance(second, NoAnswer) else BUS_BACK)
    return LeftChanged(
        f"{labels} of node {plan.node_id} could not be rolled back",
        node=plan.node_id,
        why=f"{fault}; then, while rolling back: {second}{_reason(second)}",
        hint=look,
        state="left_changed",
    )


def unreadable_left(plan: Plan, taken: Sequence[Change], fault: BaseException) -> LeftChanged:
    """The error for acknowledged changes *taken* with an unknown old value, after *fault*; the rest is rolled back."""
    names = join_some(change.label for change in taken)
    left = LeftChanged(
        f"{names} of node {plan.node_id} could not be rolled back",
        node=plan.node_id,
        why=f"{fault}{_reason(fault)}; {names} was acknowledged before that, and its old value cannot be read",
        hint="set it by hand: its old value is unknown",
        state="left_changed",
    )
    left.state_text = f"LEFT CHANGED: {names} was written; all other values of this change are rolled back and verified"
    left.details = list(fault.details) if isinstance(fault, DvtcliError) else []
    return left


def not_rolled_back(plans: Iterable[Plan], node_id: int, fault: str, why: str) -> LeftChanged:
    """The error for *plans* still in effect on *node_id*: no roll-back after *fault*, because of *why*."""
    labels = join_some(dict.fromkeys(change.label for plan in plans for change in plan.changes))
    return LeftChanged(
        f"{labels or 'what this line changed'} of node {node_id} could not be rolled back",
        node=node_id,
        why=f"{fault}; then, while taking it back: {why}",
        hint=Hint(Action.SHOW_PDOS, why="check it with {}")
        + Hint(Action.RESET_NODE, {"node": node_id}, "brings the stored settings back"),
        state="left_changed",
    )


def also_lines(reported: DvtcliError, others: Iterable[BaseException]) -> list[tuple[str, str]]:
    """Labelled lines for *others* beside *reported*, each text once.

    Several nodes asked in parallel report the same lost bus.
    """
    known = f"{reported}; {reported.why}"
    return [("also", text) for text in dict.fromkeys(map(str, others)) if text not in known]


#: How long a heartbeat is waited for that tells whether a node restarted without a boot-up message, in seconds.
HEARTBEAT_S = 1.2


def restarted_since(node: ReadableNode, initial_state: InitialState) -> bool:
    """True if *node* may have restarted since *initial_state*: a boot-up was received or an upload was repeated."""
    return node.bus.disturbance_count(node.node_id) != initial_state.disturbance_count


def left_open(node: Changeable, left: LeftChanged) -> None:
    """After a failed roll-back: block stores, and add to *left* how to finish."""
    node.pending.suspicions[CHANGE] = left.text
    node.mark_unknown()
    if node.guard is not None:
        name_journal(left, node.guard.own_journal.path, brought_back_first(left.hint))


def name_journal(left: LeftChanged, path: Path | None, first: Hint | None) -> None:
    """Add the journal at *path* to *left*, with `recover` as the next step after *first*; nothing without a journal."""
    if path is not None:
        left.place = str(path)
        left.hint = Hint(Action.RECOVER, why=f"finishes it, with the journal {verbatim(path)}").after(first)


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
        failed.state_text = f"unknown: {set_words(plan)} before that; check the node"
        if not keep_journal:
            _close(node, failed)
        raise
    if not keep_journal:
        _close(node)


def set_words(plan: Plan) -> str:
    """The result of a completed *plan* in words: verified values, and values that cannot be read back."""
    blind = [change.label for change in plan.unreadable]
    read = [change.label for change in plan.changes if change.label not in blind]
    parts = [f"{join_some(read)} was written and verified"] if read else []
    return ", ".join([*parts, *([f"{join_some(blind)} was written, which cannot be read back"] if blind else [])])


def labels_of(plan: Plan) -> str:
    """A short text of the changes in *plan*."""
    return join_some(change.label for change in plan.changes)


def _close(node: Changeable, error: BaseException | None = None) -> None:
    """Remove the journal. If removal fails, adds a note to *error*, or raises JournalKept without an error."""
    if node.guard is None:
        return
    try:
        node.guard.own_journal.end()
    except JournalKept as kept:
        if error is None:
            raise
        if isinstance(error, DvtcliError):
            error.details.append(("journal", f"{kept.text}: {kept.why}; {kept.hint}"))


def restore_nmt_state(node: Changeable, error: BaseException, initial_state: InitialState) -> None:
    """Close the journal of a rolled-back change; failures to restore the NMT state are added to *error*."""
    try:
        return_to_state(node, initial_state)
        unseen = initial_state.state is None and _rebooted(node, initial_state)
    except DvtcliError as failed:
        _add(error, f"{failed.text}: {failed.why or failed.hint}")
    except KeyboardInterrupt:
        _add(error, f"stopped once more: check the NMT state of node {node.node_id}")
    else:
        if unseen:
            _add(error, f"node {node.node_id} restarted; its NMT state before is unknown: check it")
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


def _rebooted(node: ReadableNode, initial_state: InitialState) -> bool:
    return node.bus.boot_ups(node.node_id) != initial_state.boot_ups


def return_to_state(node: Changeable, initial_state: InitialState) -> None:
    """Restore the NMT state after a reboot; inside an open gate the gate's end restores the state.

    A node that restarts without a boot-up message leaves an upload unanswered and reports another NMT state.
    """
    if initial_state.state is not NmtState.OPERATIONAL or node.gate.entered:
        return
    rebooted = _rebooted(node, initial_state)
    unsure = not rebooted and restarted_since(node, initial_state)
    if rebooted or (unsure and node.access.state(HEARTBEAT_S) is NmtState.PRE_OPERATIONAL):
        node.access.insist(NmtState.OPERATIONAL)


_RESTARTS = f"the node restarted, or lost an answer, during each of {MAX_READS} readings"


class Guarded(NamedTuple):
    """The values of *node_id* that must be as before *changes*, read through *sdo*.

    *untouched*, possibly incomplete, is reported only if different.
    """

    node_id: int
    sdo: SdoReader
    reboot_monitor: RebootMonitor
    changes: Sequence[Change]
    untouched: Sequence[Change] = ()

    @property
    def all(self) -> tuple[Change, ...]:
        """All changes to compare."""
        return (*self.changes, *self.untouched)


def name_left(left: LeftChanged, guarded: Iterable[Guarded], *, stopped: bool = False) -> None:
    """Add to *left* the changed objects, and the PDOs and objects as before, as read now.

    With *stopped* (nobody waits) nothing is read, and everything is reported as unknown.
    """
    objects: list[LeftObject] = []
    as_before: dict[int, list[str]] = {}
    for node in guarded:
        left.guarded[node.node_id] = node.all
        found = list(_unread(node, node.changes, "stopped before it was read")) if stopped else _look(node)
        objects += found
        others = {_label(change) for change in node.changes} - {row.label for row in found}
        as_before[node.node_id] = [label for label in dict.fromkeys(map(_label, node.changes)) if label in others]
    left.left = tuple(objects)
    left.as_before = {node_id: tuple(labels) for node_id, labels in as_before.items() if labels}
    left.state_text = _state_text(left)


def merge_left(left: LeftChanged, others: Iterable[LeftChanged]) -> None:
    """Add the entries of *others*, about other nodes, to *left*."""
    for other in others:
        left.left += other.left
        left.as_before |= other.as_before
        left.guarded |= other.guarded
    left.state_text = _state_text(left)


def failure_sentence(left: LeftChanged, node_id: int, done: str) -> str | None:
    """The sentence that the entries of *left* for a node could not be *done* ("rolled back"); None without entries."""
    labels = _labels(left, node_id)
    return f"{labels} of node {node_id} could not be {done}" if labels else None


def _labels(left: LeftChanged, node_id: int) -> str:
    return join_some(dict.fromkeys(row.label for row in left.left if row.node_id == node_id))


def _state_text(left: LeftChanged) -> str | None:
    """The state in words; None if nothing was to be as before."""
    nodes = dict.fromkeys([*(row.node_id for row in left.left), *left.as_before])
    texts = []
    for node_id in nodes:
        rows = [row for row in left.left if row.node_id == node_id]
        if changed := join_some(dict.fromkeys(row.label for row in rows if row.is_known)):
            texts.append(f"{changed} of node {node_id}")
        if unknown := join_some(dict.fromkeys(row.label for row in rows if not row.is_known)):
            texts.append(f"the present value of {unknown} of node {node_id} is unknown")
    same = [f"{join_some(labels)} of node {node_id} is as it was" for node_id, labels in left.as_before.items()]
    if not texts:
        if not same:
            return None
        return f"{'; '.join(same)}, read last; but the roll-back did not end: check it again"
    return "; ".join([f"LEFT CHANGED: {'; '.join(texts)}", *(f"{text}, read back equal" for text in same)])


def _look(guarded: Guarded) -> list[LeftObject]:
    """The rows of a node, all read without a restart between."""
    for _ in range(MAX_READS):
        try:
            disturbance_count = guarded.reboot_monitor.disturbance_count()
            rows = list(_rows(guarded))
            if guarded.reboot_monitor.disturbance_count() == disturbance_count:
                return rows
        except DvtcliError as dead:
            return list(_unread(guarded, guarded.changes, dead.text))
    return list(_unread(guarded, guarded.changes, _RESTARTS))


def _rows(guarded: Guarded) -> Iterator[LeftObject]:
    for number, change in enumerate(guarded.all):
        try:
            differing = list(_differing(guarded.sdo, change))
        except SdoAborted as refused:
            if change in guarded.changes:
                yield from _unread(guarded, (change,), refused.text)
        except DvtcliError as silent:  # it answers nothing about the others either
            yield from _unread(guarded, guarded.changes[number:], silent.text)
            return
        except KeyboardInterrupt:
            yield from _unread(guarded, guarded.changes[number:], "stopped before it was read")
            return
        else:
            for place, held, before, text in differing:
                yield LeftObject(
                    node_id=guarded.node_id, label=_label(change), place=place, holds=held, before=before, text=text
                )


def _differing(sdo: SdoReader, change: Change) -> Iterator[tuple[str, bytes | None, bytes | None, str]]:
    """Each changed object of *change* with present and former value, and the difference in words."""
    if isinstance(change, ValueChange):
        step = change.step
        if step.before is None:
            text = f"0x{step.object} was written, but cannot be read: its old value is unknown"
            yield step.object, None, None, text
        elif (found := differing_values(sdo, change, wanted_before=True)) is not None:
            yield step.object, *found, _words(step.object, *found)
        return
    held = read_pdo(sdo, change.pdo)
    steps: dict[str, list[Step]] = {}
    for step in plan_pdo(change.pdo, held, change.before).steps:
        steps.setdefault(step.object, []).append(step)
    for place, written in steps.items():
        is_held, was = written[0].before, written[-1].after
        if is_held != was and (is_held is not None or len(steps) == 1):  # beyond the count an entry means nothing
            yield place, is_held, was, _words(place, is_held, was)


def _words(place: str, held: bytes | None, before: bytes) -> str:
    return f"0x{place} is {'unset' if held is None else value_text(held)}, was {value_text(before)}"


def _unread(guarded: Guarded, changes: Iterable[Change], why: str) -> Iterator[LeftObject]:
    for change in changes:
        place = None if isinstance(change, PdoChange) else change.step.object
        text = f"its value is unknown: {why}"
        yield LeftObject(
            node_id=guarded.node_id,
            label=_label(change),
            place=place,
            holds=None,
            before=None,
            text=text,
            is_known=False,
        )


def _label(change: Change) -> str:
    """The PDO of *change*, even for a single object of the PDO."""
    if isinstance(change, PdoChange):
        return change.label
    pdo = Pdo.at(change.step.index)
    return change.label if pdo is None else pdo.label

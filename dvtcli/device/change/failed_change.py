"""Error texts for a failed change: the step, the device's refusal, and the remaining state of the device."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.plan import Change, Plan, Step
from dvtcli.domain.text import hex_preview, join_some
from dvtcli.errors import BusUnavailable, DeviceRefused, DvtcliError, LeftChanged, NoAnswer, SdoAborted

#: What to do about a node that restarts.
TRY_AGAIN = "look at its supply, then try again"
#: What to do first about one that does not answer, and about a bus that failed.
BRING_BACK = Hint(Action.FIND_NODES, why="bring the node back first (power, wiring, {})")
BUS_BACK = Hint(Action.CHECK_SETUP, why="bring the bus back first ({} looks at it)")


def brought_back_first(hint: Hint | str | None) -> Hint | None:
    """The part of *hint* about bringing the node or the bus back, to be done first; None without such a part."""
    known = (BRING_BACK, BUS_BACK)
    return next((first for first in known if isinstance(hint, Hint) and hint.begins_with(first)), None)


def pre_operational_first(node_id: int) -> Hint:
    """The hint to enter PRE-OPERATIONAL first, as node *node_id* is OPERATIONAL."""
    return Hint(Action.ENTER_PRE_OPERATIONAL, {"node": node_id}, "it is OPERATIONAL: {}, then again")


def step_text(step: Step) -> str:
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
    error.details.append(("step", step_text(step)))
    return error


def _reason(error: BaseException) -> str:
    return f" ({error.why})" if isinstance(error, DvtcliError) and error.why else ""


def left_changed(plan: Plan, fault: BaseException, second: BaseException) -> LeftChanged:
    """The error for a failed change with a failed roll-back: both causes and the values possibly left in the device."""
    labels = join_some(change.label for change in plan.changes)
    look = Hint(Action.SHOW_PDOS, {"all": True}, "look at it with {}; a power cycle brings the stored settings back")
    if isinstance(second, NoAnswer | BusUnavailable):
        look = look.after(BRING_BACK if isinstance(second, NoAnswer) else BUS_BACK)
    return LeftChanged(
        f"{labels} of node {plan.node_id} could not be put back",
        node=plan.node_id,
        why=f"{fault}; then, while rolling back: {second}{_reason(second)}",
        hint=look,
        state="left_changed",
    )


def refused_unreadable(begun: Sequence[Change], blind: Sequence[Change], *, is_known: bool) -> str:
    """The state after a refusal of unreadable objects *blind*, with the rest of *begun* rolled back.

    *is_known*: the device is known to have taken nothing of *blind*.
    """
    read = [change.label for change in begun if change not in blind]
    names = join_some(change.label for change in blind)
    back = f"{join_some(read)} is as it was, read back equal; " if read else ""
    if not is_known:
        return f"{names} was refused; unknown whether anything was taken: it cannot be read; {back}nothing was stored"
    return f"rolled back: {back}{names} was refused, and what it holds cannot be read; nothing was stored"


def unreadable_left(plan: Plan, taken: Sequence[Change], fault: BaseException) -> LeftChanged:
    """The error for acknowledged changes *taken* with an unknown old value, after *fault*; the rest is rolled back."""
    names = join_some(change.label for change in taken)
    left = LeftChanged(
        f"{names} of node {plan.node_id} could not be put back",
        node=plan.node_id,
        why=f"{fault}{_reason(fault)}; {names} was acknowledged before that, and what it held cannot be read",
        hint="set it by hand: its value before is not known",
        state="left_changed",
    )
    left.state_text = f"LEFT CHANGED: {names} was written; all else of this change is as it was, read back equal"
    left.details = list(fault.details) if isinstance(fault, DvtcliError) else []
    return left


def not_rolled_back(plans: Iterable[Plan], node_id: int, fault: str, why: str) -> LeftChanged:
    """The error for *plans* still in effect on *node_id*: no roll-back after *fault*, because of *why*."""
    labels = join_some(dict.fromkeys(change.label for plan in plans for change in plan.changes))
    return LeftChanged(
        f"{labels or 'what this line changed'} of node {node_id} could not be taken back",
        node=node_id,
        why=f"{fault}; then, while taking it back: {why}",
        hint=Hint(Action.SHOW_PDOS, why="look at it with {}")
        + Hint(Action.RESET_NODE, {"node": node_id}, "brings the stored settings back"),
        state="left_changed",
    )


def beside(told: DvtcliError, others: Iterable[BaseException]) -> list[tuple[str, str]]:
    """Labelled lines for *others* beside the reported error *told*, each text once.

    Several nodes asked in parallel report the same lost bus.
    """
    said = f"{told}; {told.why}"
    return [("also", text) for text in dict.fromkeys(map(str, others)) if text not in said]

"""What is said of a change that failed: the step, the device's refusal, and what the device is left with.

Knows plans and errors. Neither reads nor writes devices, and does not know what happened: it is told.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.plan import Change, Plan, Step
from dvtcli.domain.several import hex_preview, join_some
from dvtcli.errors import BusUnavailable, DeviceRefused, DvtcliError, LeftChanged, NoAnswer, SdoAborted

#: What to do about a node that restarts.
TRY_AGAIN = "look at its supply, then try again"
#: What to do first about one that does not answer, and about a bus that failed.
BRING_BACK = Hint(Action.FIND_NODES, why="bring the node back first (power, wiring, {})")
BUS_BACK = Hint(Action.CHECK_SETUP, why="bring the bus back first ({} looks at it)")


def brought_back_first(hint: Hint | str | None) -> Hint | None:
    """What *hint* says to bring back before all else, the node or the bus; None where it says neither."""
    known = (BRING_BACK, BUS_BACK)
    return next((first for first in known if isinstance(hint, Hint) and hint.begins_with(first)), None)


def pre_operational_first(node_id: int) -> Hint:
    """That node *node_id* is OPERATIONAL, and may take a change in PRE-OPERATIONAL."""
    return Hint(Action.ENTER_PRE_OPERATIONAL, {"node": node_id}, "it is OPERATIONAL: {}, then again")


def step_text(step: Step) -> str:
    """A step for a person: `0x1A00:03 <- 0x27030120  map 2703:01/32`."""
    value = (
        f"0x{int.from_bytes(step.after, 'little'):0{2 * len(step.after)}X}"
        if len(step.after) <= 4
        else hex_preview(step.after)
    )
    return f"0x{step.object} <- {value}    {step.reason}"


def refused(aborted: SdoAborted, step: Step, node_id: int, what: str) -> DeviceRefused:
    """The device's refusal of one *step*, with everything the abort said."""
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
    """The worst case: say what failed twice and what the device may be left with."""
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
    """The state after a refusal of *blind*, which cannot be read back, once the rest of *begun* was put back.

    *is_known* says whether the device is known to have taken nothing of it.
    """
    read = [change.label for change in begun if change not in blind]
    names = join_some(change.label for change in blind)
    back = f"{join_some(read)} is as it was, read back equal; " if read else ""
    if not is_known:
        return f"{names} was refused; unknown whether anything was taken: it cannot be read; {back}nothing was stored"
    return f"rolled back: {back}{names} was refused, and what it holds cannot be read; nothing was stored"


def unreadable_left(plan: Plan, taken: Sequence[Change], fault: BaseException) -> LeftChanged:
    """After *fault* all of *plan* is put back but *taken*: these were acknowledged, and nobody knows what they held."""
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


def not_taken_back(plans: Iterable[Plan], node_id: int, fault: str, why: str) -> LeftChanged:
    """What *plans* changed on *node_id* stays, since after *fault* it could not be taken back, and *why*."""
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
    """The labelled lines for *others* beside the one that is *told*: each text once, and none that it says itself.

    A bus that is gone is so for every node that was asked side by side.
    """
    said = f"{told}; {told.why}"
    return [("also", text) for text in dict.fromkeys(map(str, others)) if text not in said]

"""Apply a plan, and again in another way if the device refuses it: with the PDO disabled, or in PRE-OPERATIONAL.

What a device type requires is learned, and done at once from then on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.change.apply_plan import apply_plan
from dvtcli.device.change.failed_change import pre_operational_first
from dvtcli.device.habits import OFTEN_ENOUGH, Habit, name_of
from dvtcli.device.proposal import proposal
from dvtcli.device.seen_state import present_state
from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, plan_pdo
from dvtcli.domain.rules import check_pdo, errors_in
from dvtcli.domain.rules.finding import NOTE, Finding, Rule, note
from dvtcli.errors import DeviceRefused, DvtcliError, SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.device.change.changeable import Changeable
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.device.observe import InitialState

#: What stricter families answer to a parameter of a PDO that is on.
_WHILE_ON = (Abort.VALUE_RANGE, Abort.DEVICE_STATE, Abort.READ_ONLY)
#: What devices answer to a PDO write that they take in PRE-OPERATIONAL only.
_WHILE_OPERATIONAL = (Abort.DEVICE_STATE, Abort.GENERAL)
RULES = (
    Rule("off-first", NOTE, "the device accepts this parameter only while the PDO is off", "the device's own answer",
         _WHILE_ON),
    Rule("pre-operational-first", NOTE, "the device accepts PDO writes only in PRE-OPERATIONAL",
         "the device's own answer", _WHILE_OPERATIONAL),
)  # fmt: skip


def apply_with_retry(
    node: Changeable,
    plan: Plan,
    findings: tuple[Finding, ...],
    initial_state: InitialState | None,
    done: Callable[[Plan, int], None],
    *,
    is_remembered: bool = False,
) -> tuple[Plan, tuple[Finding, ...]]:
    """Apply *plan*; return the plan in its final form, and *findings* with the device's requirements.

    If the device refuses a parameter of an enabled PDO and the roll-back succeeded, the plan is repeated once with the
    PDO disabled. If it refuses a PDO write for its state and is OPERATIONAL, the plan is repeated once in PRE-
    OPERATIONAL, with consent. A requirement seen twice is learned for the device type: from then on the PDO is
    disabled, or the device brought to PRE-OPERATIONAL, at once.
    """
    plan = _as_known(node, plan)

    run: _ApplyOnce = partial(apply_plan, node, findings=findings, done=done, is_remembered=is_remembered)
    if _wants_pre_operational(node, plan) and present_state(node.access) is NmtState.OPERATIONAL:
        node.gate.wanted = node.gate.consent
    try:
        try:
            run(plan, initial_state)
        except DeviceRefused as refused:
            plan, remark = _apply_again(node, plan, refused, run)
            return plan, (*findings, remark)
    finally:
        node.gate.wanted = None
    return plan, findings


#: carries a plan out; None: the node is claimed anew
_ApplyOnce = Callable[[Plan, "InitialState | None"], None]


def _apply_again(node: Changeable, plan: Plan, refused: DeviceRefused, run: _ApplyOnce) -> tuple[Plan, Finding]:
    """Repeat *plan* after a refused step in another way; the final plan, and a finding.

    Raises *refused* if there is no other way.
    """
    change, step = _refused_while_on(plan, refused)
    if change is not None and step is not None and _may_be_off(node, change):
        again, passing = _with_off(plan, change), _may_pass(node, refused)
        try:
            run(again, None)
        except DvtcliError as second:
            second.details.append(("first try", f"0x{step.object} was refused while {change.label} was on, too"))
            if not isinstance(second, DeviceRefused) or not _is_for_its_state(node, again, second):
                raise
            return again, _in_pre_operational(node, again, second, run)
        remembered = (
            "the node was OPERATIONAL, so nothing is remembered" if passing else _noted(node, change, step, refused)
        )
        text = (
            f"0x{step.object} was refused while {change.label} was on (abort 0x{refused.abort or 0:08X}): all was put "
            f"back, and done again with {change.label} off; {remembered}"
        )
        return again, note("off-first", f"0x{step.object}", text)
    if not _is_for_its_state(node, plan, refused):
        raise refused
    return plan, _in_pre_operational(node, plan, refused, run)


def _is_for_its_state(node: Changeable, plan: Plan, refused: DeviceRefused) -> bool:
    """True if a PDO write was refused and rolled back, possibly because the node is OPERATIONAL."""
    steps = {step.object for change in plan.changes for step in change.steps if _changes_pdo(change)}
    return (
        refused.state == "rolled_back"
        and refused.abort in _WHILE_OPERATIONAL
        and refused.place in steps
        and not node.gate.entered
        and present_state(node.access) is NmtState.OPERATIONAL
    )


def _in_pre_operational(node: Changeable, plan: Plan, refused: DeviceRefused, run: _ApplyOnce) -> Finding:
    """Apply *plan* in PRE-OPERATIONAL after consent; raises *refused* without consent."""
    try:
        node.consent_anew(node.gate.question)
    except SafetyRefusal as declined:
        refused.hint = pre_operational_first(node.node_id) + Hint(Action.AGREE, why="or {}: it goes there and back")
        raise refused from declined
    node.gate.wanted = lambda _question: None
    try:
        run(plan, None)
    except DvtcliError as second:
        second.details.append(("first try", f"0x{refused.place} was refused while the node was OPERATIONAL, too"))
        raise
    times = node.habits.add(node.identity(), Habit(None, refused.abort or 0))
    text = (
        f"0x{refused.place} was refused while node {node.node_id} was OPERATIONAL (abort 0x{refused.abort or 0:08X}): "
        f"all was rolled back, and done again in PRE-OPERATIONAL; {_remembered(node, times, 'brought there')}"
    )
    return note("pre-operational-first", f"0x{refused.place}", text)


def _wants_pre_operational(node: Changeable, plan: Plan) -> bool:
    """True if the device type is known to take a PDO change like *plan* only in PRE-OPERATIONAL."""
    return any(map(_changes_pdo, plan.changes)) and not node.gate.entered and node.is_found_to_want_pre_operational


def _changes_pdo(change: Change) -> bool:
    return isinstance(change, PdoChange) or Pdo.at(change.step.index) is not None


def _noted(node: Changeable, change: PdoChange, step: Step, refused: DeviceRefused) -> str:
    """Record the device's requirement; the consequence for the next time, for display."""
    times = node.habits.add(node.identity(), Habit((change.pdo.direction, step.sub_index), refused.abort or 0))
    return _remembered(node, times, "disabled")


def _remembered(node: ReadableNode, times: int, what: str) -> str:
    """The consequence of a requirement seen *times* times, for display; *what* is done first from then on."""
    if times < OFTEN_ENOUGH:
        return "if it happens again, it is remembered"
    if not name_of(node.identity()):
        return f"from now on it is {what} first; the node says no identity, so no later process knows"
    return "this is saved as a need of devices like this one"


def _may_pass(node: ReadableNode, refused: DeviceRefused) -> bool:
    """True if *refused* gives the device's present state as the only reason, and the device is running."""
    return refused.abort == Abort.DEVICE_STATE and present_state(node.access) is NmtState.OPERATIONAL


def _refused_while_on(plan: Plan, refused: DeviceRefused) -> tuple[PdoChange, Step] | tuple[None, None]:
    """The change and the step *refused* while a PDO was enabled; None if another step was refused."""
    if refused.state == "rolled_back" and refused.abort in _WHILE_ON:
        for change in plan.changes:
            if isinstance(change, PdoChange):
                for step in _while_on(change):
                    if step.object == refused.place:
                        return change, step
    return None, None


def _while_on(change: PdoChange) -> Iterator[Step]:
    """The steps of *change* that write a parameter of an enabled PDO."""
    if not change.before.enabled:
        return
    for step in change.steps:
        if step.index != change.pdo.communication_index or step.sub_index == 1:
            return
        yield step


def _as_known(node: Changeable, plan: Plan) -> Plan:
    """*plan* adapted to the known requirements of this device."""
    candidates = [change for change in plan.changes if isinstance(change, PdoChange) and any(_while_on(change))]
    if not candidates or not node.habits.are_there:
        return plan
    off_first = node.habits.off_first(node.identity())
    for change in candidates:
        wants = any((change.pdo.direction, step.sub_index) in off_first for step in _while_on(change))
        if wants and _may_be_off(node, change):
            plan = _with_off(plan, change)
    return plan


def _may_be_off(node: ReadableNode, change: PdoChange) -> bool:
    """True if the rules allow the PDO to be enabled again, both as planned and as before."""
    off = change.before.disabled()
    return not any(_errors(node, change, off, want) for want in (change.after, change.before))


def _errors(node: ReadableNode, change: PdoChange, now: PdoConfig, want: PdoConfig) -> tuple[Finding, ...]:
    return errors_in(check_pdo(proposal(node, change.pdo, now, want)))


def _with_off(plan: Plan, change: PdoChange) -> Plan:
    """*plan* with the PDO of *change* disabled before its first write."""
    off = plan_pdo(change.pdo, change.before, change.after, disabled_first=True)._replace(substitute=change.substitute)
    return replace(plan, changes=tuple(off if planned is change else planned for planned in plan.changes))

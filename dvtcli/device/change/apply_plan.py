"""Apply a plan to a node: gate, lock, backup, journal, transaction, and the NMT state afterwards.

If the device refuses the plan, it is applied again in another way: with the PDO disabled, or in PRE-OPERATIONAL. What a
device type requires is learned, and done at once from then on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import count
from typing import TYPE_CHECKING

from dvtcli.device.change.applied import Progress
from dvtcli.device.change.failed_change import (
    TRY_AGAIN,
    end_change,
    explain_refusal,
    labels_of,
    left_open,
    pre_operational_first,
    restarted_since,
    restore_nmt_state,
    return_to_state,
)
from dvtcli.device.change.roll_back import first_difference
from dvtcli.device.change.transaction import Transaction
from dvtcli.device.change.untouched_pdos import (
    UntouchedPdos,
    changes_a_pdo,
    unlike_backups,
    untouched_cob_ids,
    untouched_configs,
    untouched_pdos,
)
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
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, Restarted, SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.device.change.changeable import Changeable
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.rules.finding import Finding


#: below it there is no control word
_FIRST_OF_MAKER = 0x2000


def apply_plan(
    node: Changeable,
    plan: Plan,
    initial_state: InitialState | None = None,
    findings: tuple[Finding, ...] = (),
    *,
    done: Callable[[Plan, int], None] = lambda _plan, _boot_ups: None,
    is_remembered: bool = False,
    keep_journal: bool = False,
) -> None:
    """Take *node* to where *plan* ends, or leave it as it was; a signal waits for a safe point, or comes too late.

    *initial_state* is the node's state when the plan was made; None: it is read now. *findings* are what the rules
    said of the plan; they explain a refusal of something that was forced. *done* is called with the plan and the
    number of boot-ups so far once the plan was read back, before anything else can fail. With *is_remembered* `undo`
    can revert the change later. With *keep_journal* the journal stays open after a complete change: the caller rolls it
    back. Raises LeftChanged, which names the journal, if the plan fails and the roll-back fails too.
    """
    with node.cancellation.deferred():
        initial_state = node.begin_change() if initial_state is None else initial_state
        node.require_not_restarted(initial_state)
        is_watched = _is_watched(node, plan)
        if is_watched:
            node.known_pdos()
        cob_ids = untouched_cob_ids(node, plan)
        if node.guard is not None:
            pdos, held = node.known_pdos, node.last_read
            node.guard.begin(
                plan,
                node.identity(),
                initial_state.state,
                pdos,
                held,
                is_test=keep_journal,
                is_remembered=is_remembered,
            )
        try:
            untouched = untouched_configs(node, plan, initial_state)
            unread = any(config.lacking for config in node.last_read.values())
            enter(node, initial_state)
            node.require_not_restarted(initial_state)
            others = UntouchedPdos(
                cob_ids, untouched, partial(untouched_pdos, node, plan), partial(unlike_backups, node)
            )
            transaction = _transaction(node, plan, others, initial_state)
            try:
                transaction.run()
            finally:
                node.forget()
        except LeftChanged as left:
            left_open(node, left)
            raise
        except BaseException as error:
            node.has_reported_restart |= restarted_since(node, initial_state)
            if isinstance(error, DvtcliError):
                explain_refusal(node, error, findings)
            restore_nmt_state(node, error, initial_state)
            raise
        node.differing_control_words = dict(transaction.differing_control_words)
        node.expected.seen(untouched, complete=is_watched and not unread)
        if node.guard is not None:
            node.guard.own_journal.carried_out()
        done(plan, transaction.boot_ups_verified)
        end_change(node, plan, lambda: return_to_state(node, initial_state), keep_journal=keep_journal)
    node.cancellation.hold()


def enter(node: Changeable, initial_state: InitialState) -> None:
    """Enter the gate for PDO writes; a node that restarted since *initial_state* OPERATIONAL returns to it."""
    was_in = node.gate.entered
    node.gate.enter()
    if not was_in and node.gate.entered and node.gate.found is None and restarted_since(node, initial_state):
        node.gate.found = initial_state.state


def read_changes_again(
    node: Changeable, plan: Plan, initial_state: InitialState | None, what: str = "restarted while it was looked at"
) -> None:
    """Read all that *plan* changes again. Raises Restarted, saying *what* happened, if *node* has lost the change.

    Makes no further write. Brings the node back to the NMT state *initial_state*, if given.
    """
    differences = node.observed(lambda: [first_difference(node.sdo, change) for change in plan.changes])
    if initial_state is not None:
        return_to_state(node, initial_state)
    difference = next(filter(None, differences), None)
    if difference is not None:
        raise Restarted(
            f"node {node.node_id} {what}: {labels_of(plan)} differs from the request",
            node=node.node_id,
            why=difference,
            hint=TRY_AGAIN,
        )


def _is_watched(node: Changeable, plan: Plan) -> bool:
    """True if the PDOs outside *plan* must be read for comparison by a later store of this process.

    A program with a single change stores nothing afterwards and saves these uploads.
    """
    return changes_a_pdo(plan) and not node.is_last_change() and not node.expected.is_complete


def _transaction(node: Changeable, plan: Plan, others: UntouchedPdos, initial_state: InitialState) -> Transaction:
    """Return the transaction that writes *plan*, made when *node* was in *initial_state*; it watches *others*."""

    def note_altered(changes: Sequence[Change]) -> None:
        if node.guard is None:
            return
        try:
            node.guard.own_journal.note(Plan(plan.node_id, tuple(changes)))
        except SafetyRefusal as failed:  # a way back does not wait for a disk
            node.guard.warn(f"{failed.text}: if this process is killed now, a recovery does not have the whole change")

    steps, total = count(1), len(plan)

    def took(step: Step) -> None:
        node.on_step(Progress(plan.node_id, next(steps), total, step))

    return Transaction(
        node.sdo,
        plan,
        cancellation=node.cancellation,
        explain=node.access.explain,
        before_retry=node.gate.renew,
        clock=node.bus,
        reboot_monitor=node.reboot_monitor,
        others=others,
        on_altered=note_altered,
        on_step=took,
        control_words=_control_words(node, plan),
        boot_ups_read=None if initial_state.ignores_restarts else initial_state.boot_ups,
    )


def _control_words(node: NodeDescription, plan: Plan) -> frozenset[tuple[int, int]]:
    """The control word if *plan* writes nothing else, unless a virtual PDO of the device writes it."""
    step = next(iter(plan.steps)) if len(plan) == 1 else None
    if step is None or Pdo.at(step.index) is not None or step.index < _FIRST_OF_MAKER:
        return frozenset()
    from dvtcli.domain.process_data import is_control_word
    from dvtcli.domain.profile import within

    dictionary, place = node.dictionary, (step.index, step.sub_index)
    entry = None if dictionary is None else dictionary.entry(*place)
    names = "" if dictionary is None or entry is None else f"{entry.name} {dictionary.display_name(*place)}"
    is_driven = any(within(step.index, group.drives) for group in node.profile.vpdo.values())
    return frozenset({place}) if is_control_word(step.index, entry, names) and not is_driven else frozenset()


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
    PDO disabled. If it refuses a PDO write for its state and is OPERATIONAL, the plan is repeated once in
    PRE-OPERATIONAL, with consent. A requirement seen twice is learned for the device type: from then on the PDO is
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

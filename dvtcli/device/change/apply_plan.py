"""Apply a plan to a node: gate, lock, backup, journal, transaction, and the NMT state afterwards."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Change, Plan, Step
from dvtcli.errors import DvtcliError, LeftChanged, Restarted, SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.device.change.changeable import Changeable
    from dvtcli.device.node_parts import NodeDescription
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


def look_again(
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

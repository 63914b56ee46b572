"""Apply a plan to a node: gate, lock, backup, journal, transaction, and the NMT state afterwards."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import count
from typing import TYPE_CHECKING

from dvtcli.device.change.after_change import (
    end_change,
    explain_refusal,
    labels_of,
    left_open,
    restarted_since,
    restore_nmt_state,
    return_to_state,
)
from dvtcli.device.change.failed_change import TRY_AGAIN
from dvtcli.device.change.progress import Progress
from dvtcli.device.change.roll_back import first_difference
from dvtcli.device.change.transaction import Transaction
from dvtcli.device.change.untouched_pdos import (
    UntouchedPdos,
    cob_ids_beside,
    is_of_pdo,
    present_beside,
    unlike_kept,
    wholes_beside,
)
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Change, Plan, Step
from dvtcli.errors import DvtcliError, LeftChanged, Restarted, SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.device.change.changeable import Changeable
    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.rules import Finding

#: below it there is no control word
_FIRST_OF_MAKER = 0x2000


def apply_plan(
    node: Changeable,
    plan: Plan,
    found: InitialState | None = None,
    findings: tuple[Finding, ...] = (),
    *,
    done: Callable[[Plan, int], None] = lambda _plan, _boot_ups: None,
    is_kept: bool = False,
    keep_journal: bool = False,
) -> None:
    """Take *node* to where *plan* ends, or leave it as it was; a signal waits for a safe point, or comes too late.

    *found* is the node's state when the plan was made; None: it is read now. *findings* are what the rules said of the
    plan; they explain a refusal of something that was forced. *done* is called with the plan and the number of boot-ups
    so far once the plan was read back, before anything else can fail. *is_kept* says that `undo` is to remember the
    change. With *keep_journal* the journal of a change that stands is left open: the caller rolls the change back.
    Raises LeftChanged, which names the journal, if the plan fails and the roll-back fails too.
    """
    with node.cancellation.guard():
        found = node.begin_change() if found is None else found
        node.require_not_restarted(found)
        is_watched = _is_watched(node, plan)
        if is_watched:
            node.known_pdos()
        cob_ids = cob_ids_beside(node, plan)
        if node.keeper is not None:
            pdos, held = node.known_pdos, node.last_read
            node.keeper.begin(plan, node.identity(), found.state, pdos, held, is_test=keep_journal, is_kept=is_kept)
        try:
            beside = wholes_beside(node, plan, found)
            untold = any(config.lacking for config in node.last_read.values())
            enter(node, found)
            node.require_not_restarted(found)
            others = UntouchedPdos(cob_ids, beside, partial(present_beside, node, plan), partial(unlike_kept, node))
            transaction = _transaction(node, plan, others, found)
            try:
                transaction.run()
            finally:
                node.forget()
        except LeftChanged as left:
            left_open(node, left)
            raise
        except BaseException as error:
            node.told_restart |= restarted_since(node, found)
            if isinstance(error, DvtcliError):
                explain_refusal(node, error, findings)
            restore_nmt_state(node, error, found)
            raise
        node.answered_otherwise = dict(transaction.answered_otherwise)
        node.expected.seen(beside, whole=is_watched and not untold)
        if node.keeper is not None:
            node.keeper.own_journal.carried_out()
        done(plan, transaction.boot_ups_verified)
        end_change(node, plan, lambda: return_to_state(node, found), keep_journal=keep_journal)
    node.cancellation.hold()


def enter(node: Changeable, found: InitialState) -> None:
    """Make PDO writes possible; a node that restarted since *found* OPERATIONAL returns to OPERATIONAL at the end."""
    was_in = node.gate.entered
    node.gate.enter()
    if not was_in and node.gate.entered and node.gate.found is None and restarted_since(node, found):
        node.gate.found = found.state


def look_again(
    node: Changeable, plan: Plan, found: InitialState | None, what: str = "restarted while it was looked at"
) -> None:
    """Read all that *plan* changes again. Raises Restarted, saying *what* happened, if *node* has lost the change.

    Makes no further write. Brings the node back to the NMT state *found*, if given.
    """
    differences = node.observed(lambda: [first_difference(node.sdo, change) for change in plan.changes])
    if found is not None:
        return_to_state(node, found)
    difference = next(filter(None, differences), None)
    if difference is not None:
        raise Restarted(
            f"node {node.node_id} {what}: {labels_of(plan)} is not as wanted any more",
            node=node.node_id,
            why=difference,
            hint=TRY_AGAIN,
        )


def _is_watched(node: Changeable, plan: Plan) -> bool:
    """True if the PDOs outside *plan* must be read for comparison by a later store of this process.

    A program with a single change stores nothing afterwards and saves these uploads.
    """
    return is_of_pdo(plan) and not node.only_one() and not node.expected.is_whole


def _transaction(node: Changeable, plan: Plan, others: UntouchedPdos, found: InitialState) -> Transaction:
    """The transaction that writes *plan*, made from what was read since *node* was *found*, and watches *others*."""

    def note(changes: Sequence[Change]) -> None:
        if node.keeper is None:
            return
        try:
            node.keeper.own_journal.note(Plan(plan.node_id, tuple(changes)))
        except SafetyRefusal as failed:  # a way back does not wait for a disk
            node.keeper.warn(f"{failed.text}: if this ends before its time, a recovery does not know all of it")

    steps, total = count(1), len(plan)

    def took(step: Step) -> None:
        node.on_step(Progress(plan.node_id, next(steps), total, step))

    return Transaction(
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
        control_words=_control_words(node, plan),
        boot_ups_read=None if found.whatever_happened else found.boot_ups,
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

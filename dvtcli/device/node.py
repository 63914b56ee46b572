"""One node for a command: its PDOs, its changes, and the means to change it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.change.change_group import ChangeGroup, OrderedChange
from dvtcli.device.change.changeable import Changeable
from dvtcli.device.store.pending import COMMUNICATION, EVERYTHING
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import BusUnavailable, DeviceRefused, DvtcliError, Restarted

if TYPE_CHECKING:
    from dvtcli.device.change.applied import Applied
    from dvtcli.device.change.undo_plan import UndoRequest
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.plan import Change, PdoChange, Plan, ValueChange
    from dvtcli.domain.request import AnyPdoRequest
    from dvtcli.domain.rules.finding import Finding


@dataclass(slots=True, eq=False, repr=False)
class Node(Changeable):
    """A node to configure, write and undo, with the changes of this session."""

    #: applied plans for `undo`, oldest first
    history: list[Plan] = field(default_factory=list)
    #: this session's changes on all nodes, oldest first
    change_order: list[OrderedChange] = field(default_factory=list)
    #: the current change group of the session
    group: ChangeGroup = field(default_factory=ChangeGroup)
    #: label -> change of this line that the node keeps without a store
    saved_automatically: dict[str, Change] = field(default_factory=dict)
    #: boot-up messages seen when the first of them was read back
    saved_boot_ups: int = 0
    #: commands of this session without a change, not yet reported by `undo`
    unchanged_commands: int = 0
    #: labels of losses by a restart during a change, still to be reported
    _unreported_losses: tuple[str, ...] = ()
    #: the difference between the device and its file; empty if none
    unlike_file: str = ""
    #: undone changes of earlier sessions
    undone_earlier: int = 0
    #: whether a change of this session was undone
    undid_own: bool = False

    def configure(
        self, wants: Mapping[Pdo, AnyPdoRequest], *, force: bool = False, initial_state: InitialState | None = None
    ) -> Applied:
        """Set each PDO to *wants*, all or none: check, write the differences, read back, roll back on failure.

        *initial_state* is the result of an earlier `begin_change`: reads since then count. Raises errors of `resolve`
        for a request impossible on this node, RuleError if a rule forbids the change.
        """
        from dvtcli.device.change.applied import refuse
        from dvtcli.device.file_fits import refuse_unlike_file
        from dvtcli.device.other_producers import received_ids, seen_producer_findings
        from dvtcli.device.proposal import proposal, resolve, untyped_lengths
        from dvtcli.domain.plan import Plan, plan_pdo
        from dvtcli.domain.request import instead_findings, requested_parameters
        from dvtcli.domain.rules import check_pdo
        from dvtcli.domain.rules.communication import timer_findings
        from dvtcli.domain.text import join_some

        refuse_unlike_file(self.node_id, self.unlike_file, force=force)
        look = self.pdo if initial_state is None else self.known_pdo
        with received_ids(self.bus) as received:
            initial_state = initial_state or self.begin_change()
            lengths = untyped_lengths(self, wants.values())
            now = self.observed(lambda: {pdo: look(pdo) for pdo in wants})  # equal PDOs are not read again
            wanted = {pdo: resolve(self, pdo, now[pdo], want, lengths) for pdo, want in wants.items()}
            changes_of = {pdo: (now[pdo], want) for pdo, want in wanted.items()}
            findings: list[Finding] = []
            for pdo, change in changes_of.items():
                findings += _fitting(seen_producer_findings(self, {pdo: change}, received), pdo, wants[pdo])
        for pdo, want in wanted.items():
            if now[pdo] != want or not want.has_cob_id:  # the present state is unknown
                proposed = proposal(self, pdo, now[pdo], want, wanted)
                judged = (*instead_findings(wants[pdo], proposed), *check_pdo(proposed), *timer_findings(proposed))
                findings += _fitting(judged, pdo, wants[pdo])
        labels = join_some(pdo.label for pdo in wanted)
        # with nothing to write, force would only turn "unknown" into "equal"
        can_force = all(now[pdo] != want or want.has_cob_id for pdo, want in wanted.items())
        refuse(tuple(findings), f"{labels} not changed", self.node_id, force=force, can_force=can_force)
        changes = tuple(plan_pdo(pdo, now[pdo], want) for pdo, want in wanted.items())
        applied = self.apply(Plan(self.node_id, changes), tuple(findings), force=force, initial_state=initial_state)
        for pdo, asked in wants.items():
            self._note_request(pdo, requested_parameters(asked))
        return applied

    def write(self, index: int, sub_index: int, data: bytes, *, force: bool = False) -> Applied:
        """Write one object as a plan of one step, under the rules of the matching command."""
        from dvtcli.device.access_level import refuse_passcode
        from dvtcli.device.change.applied import refuse
        from dvtcli.device.file_fits import refuse_unlike_file
        from dvtcli.device.other_producers import received_ids, seen_producer_findings
        from dvtcli.device.raw_write import held_value, raw_change, raw_write_findings, taken_can_id_findings
        from dvtcli.device.store.unstored import prepare_store
        from dvtcli.domain.plan import PdoChange, Plan, Step
        from dvtcli.domain.request import hinting_at_set, parameters_at

        refuse_passcode(self.access, index, sub_index)
        refuse_unlike_file(self.node_id, self.unlike_file, force=force)
        initial_state = self.begin_change()
        if self.saves((index, sub_index)):
            prepare_store(self, force=force)
        what = f"0x{index:04X}:{sub_index:02X} not written"
        with received_ids(self.bus) as received:
            findings = raw_write_findings(self, index, sub_index, data)
            if (pdo := Pdo.at(index)) is not None:
                findings = tuple(hinting_at_set(findings, pdo, enables=False))
            findings = (*findings, *taken_can_id_findings(self, index, sub_index, data))
            refuse(findings, what, self.node_id, force=force)
            change = raw_change(self, Step(index, sub_index, held_value(self, index, sub_index), data, "write"))
            if isinstance(change, PdoChange):
                changes = {change.pdo: (change.before, change.after)}
                received_findings = seen_producer_findings(self, changes, received)
                findings = (*findings, *hinting_at_set(received_findings, change.pdo, enables=False))
                refuse(findings, what, self.node_id, force=force)
        applied = self.apply(Plan(self.node_id, (change,)), findings, force=force, initial_state=initial_state)
        if isinstance(change, PdoChange):
            self._note_request(change.pdo, parameters_at(change.pdo, index, sub_index))
        return applied

    def _note_request(self, pdo: Pdo, parameters: frozenset[str]) -> None:
        self.requested[pdo] = self.requested.get(pdo, frozenset()) | parameters

    def continue_from(self, before: Node) -> None:
        """Continue as the device *before*, opened again: keep this session's changes, discard all reads."""
        self.history, self.undone_earlier, self.requested = before.history, before.undone_earlier, before.requested
        self.wanted, self.wanted_values = before.wanted, before.wanted_values
        self.unreadable_values = before.unreadable_values
        self.unchanged_commands, self.undid_own = before.unchanged_commands, before.undid_own
        self.pending, self.expected = before.pending, before.expected

    def lost_during_gap(self) -> tuple[str, ...]:
        """After a gap in monitoring: labels of unstored changes that the node has lost."""
        from dvtcli.device.target_config import TargetConfig, config_differences

        pdos = {pdo: config for pdo, config in self.wanted.items() if pdo.label in self.unstored}
        values = {at: data for at, data in self.wanted_values.items() if f"{at[0]:04X}:{at[1]:02X}" in self.unstored}
        lost = tuple(dict.fromkeys(label for label, _ in config_differences(self, TargetConfig(pdos, values))))
        if lost:
            self.pending.lost(lost)
            self.pending.lost_until = len(self.history)
        return lost

    def apply(
        self,
        plan: Plan,
        findings: tuple[Finding, ...] = (),
        *,
        force: bool = False,
        remembered: bool = True,
        initial_state: InitialState | None = None,
        is_part_of_group: bool = False,
    ) -> Applied:
        """Run a checked *plan* inside the gate; on a real bus with lock, backup and journal.

        With *remembered* `undo` can revert it. *initial_state* is the result of `begin_change` before the reads that
        the plan is based on. *is_part_of_group* marks one of several plans, which end a configuration stamp themselves.
        """
        from dvtcli.device.access_level import level_findings
        from dvtcli.device.change.applied import Applied, refuse
        from dvtcli.device.change.apply_plan import apply_with_retry
        from dvtcli.device.change.expected_refusals import with_undo_findings
        from dvtcli.domain.text import join_some

        self.differing_control_words = {}
        if len(plan):
            plan, warnings = with_undo_findings(self, plan if is_part_of_group else self._with_stamp_ended(plan))
            locked = (*level_findings(self.access, plan), *(warnings if remembered else ()))
            refuse(
                locked, f"{join_some(change.label for change in plan.changes)} not changed", self.node_id, force=force
            )
            findings += locked
            plan, findings = apply_with_retry(
                self,
                plan,
                findings,
                initial_state,
                lambda carried_out, boot_ups: self._record_verified(carried_out, boot_ups, remembered=remembered),
                is_remembered=remembered,
            )
            findings += self._unreadable_findings(plan)
        else:
            if (
                initial_state is not None
                and self.bus.disturbance_count(self.node_id) != initial_state.disturbance_count
            ):
                from dvtcli.device.change.apply_plan import read_changes_again

                read_changes_again(self, plan, initial_state)
            self.unchanged_commands += remembered and not is_part_of_group
            self._remember(plan.changes)
        unreadable = tuple(finding.place.removeprefix("0x") for finding in self._unreadable_findings(plan))
        return Applied(plan, findings, unreadable=unreadable)

    def _unreadable_findings(self, plan: Plan) -> tuple[Finding, ...]:
        """A warning for each object that does not read back as written by *plan*."""
        if not (plan.unreadable or self.differing_control_words):
            return ()
        from dvtcli.domain.plan import ValueChange
        from dvtcli.domain.rules.raw_write import unreadable_finding

        blind = [(change.step.index, change.step.sub_index) for change in plan.unreadable]
        return (
            *(unreadable_finding(*place) for place in blind),
            *(
                unreadable_finding(change.step.index, change.step.sub_index, self.differing_control_words[change.label])
                for change in plan.changes
                if isinstance(change, ValueChange) and change.label in self.differing_control_words
            ),
        )

    def _with_stamp_ended(self, plan: Plan) -> Plan:
        """*plan*, preceded by the removal of our stamp if the stamp covers a changed object."""
        from dvtcli.domain.objects import VERIFY_CONFIGURATION

        if self.has_no_stamp or (self.dictionary is not None and VERIFY_CONFIGURATION not in self.dictionary):
            return plan
        from dvtcli.device.stamped import with_stamp_ended

        return with_stamp_ended(self, plan)

    def _record_verified(self, plan: Plan, boot_ups: int, *, remembered: bool) -> None:
        """Record *plan* as verified after *boot_ups* boot-ups, before any later step can fail.

        These boot-ups cleared earlier changes, but nothing of the plan.
        """
        from dvtcli.device.change.failed_change import set_words
        from dvtcli.domain.plan import alters

        self._received(boot_ups)
        self.await_no_restart()
        self.gate.done.append(set_words(plan))
        saves = any(self.saves((step.index, step.sub_index)) for step in plan.steps)
        if remembered and not saves and any(map(alters, plan.changes)):
            self.remember_for_undo(plan)
        elif remembered and not saves:
            self.unchanged_commands += 1
        self._remember(plan.changes)
        needed = self.profile.store.needed_for
        by_itself = [change for change in plan.changes if change.steps and not needed(change.steps[0].index)]
        if by_itself and not self.saved_automatically:
            self.saved_boot_ups = boot_ups
        readable = (change for change in by_itself if change.label not in self.differing_control_words)
        self.saved_automatically |= {change.label: change for change in readable}

    def require_saved(self) -> None:
        """Read this line's changes that need no store again if the node restarted since the read-back.

        Raises Restarted if the node has lost them: nothing else reports the loss.
        """
        changes = tuple(self.saved_automatically.values())
        try:
            if not changes or self.bus.boot_ups(self.node_id) == self.saved_boot_ups:
                return
        except BusUnavailable:
            return  # as for `notice_reboot`
        from dvtcli.device.change.apply_plan import read_changes_again
        from dvtcli.domain.plan import Plan

        read_changes_again(self, Plan(self.node_id, changes), None, "restarted after it was changed")

    def remember_for_undo(self, plan: Plan) -> None:
        """Record the completed *plan* for undo, by this session and on a real bus by later sessions."""
        self.history.append(plan)
        self.change_order.append(OrderedChange(self.node_id, self.group.id))
        if self.guard is not None:
            self.guard.remember(plan)

    def saves(self, place: tuple[int, int]) -> bool:
        """True if a write to *place* makes this family store its settings; such a write cannot be undone."""
        return place == self.profile.store.saved_by

    @property
    def unstored(self) -> dict[str, int]:
        """Labels of the changes since the last store, in order, each with the index."""
        return self.pending.unstored

    def _remember(self, changes: tuple[Change, ...]) -> None:
        from dvtcli.domain.plan import PdoChange, alters

        for change in changes:
            if change.label not in self.differing_control_words:
                self.expected.changed(change)
            if isinstance(change, PdoChange):
                self.wanted[change.pdo] = self._shown[change.pdo] = change.after
            elif Pdo.at(change.step.index) is None:
                self._remember_value(change)
            if any(self.saves((step.index, step.sub_index)) for step in change.steps):
                from dvtcli.device.store.unstored import mark_stored

                mark_stored(self, self.pending.was_stored(EVERYTHING, len(self.history)))
            elif alters(change) and self.profile.store.needed_for(change.steps[0].index):
                self.pending.changed(change.label, change.steps[0].index)

    def _remember_value(self, change: ValueChange) -> None:
        """Record the value of a single write for `verify`; an unreadable object is only named there."""
        place = change.step.index, change.step.sub_index
        if self.saves(place):
            return
        values, other = self.wanted_values, self.unreadable_values
        if not change.is_readable or change.label in self.differing_control_words:
            values, other = other, values
        values[place] = change.step.after
        other.pop(place, None)

    def was_reset(self, *, communication: bool) -> tuple[str, ...]:
        """Record a requested reset and return the labels of lost changes.

        *communication*: only communication objects were reset.
        """
        self.mark_unknown()
        self.saved_automatically.clear()
        if self.restarts_at_read is not None:
            self.restarts_at_read = self.bus.restarts(self.node_id)
        self.expected.clear()
        self.pending.lost_until = len(self.history)
        return self.pending.was_reset(COMMUNICATION if communication else EVERYTHING, self.bus.boot_ups(self.node_id))

    def notice_reboot(self) -> tuple[str, ...]:
        """Labels of unstored changes lost by an unexpected restart; empty if there was none."""
        try:
            boot_ups = self.bus.boot_ups(self.node_id)
        except BusUnavailable:
            return ()  # a dead bus reports nothing; the caller that needs the bus reports the failure
        self._received(boot_ups)
        lost, self._unreported_losses = self._unreported_losses, ()
        return lost

    def _received(self, boot_ups: int) -> None:
        """Record *boot_ups* boot-ups; the losses of the latest are still to be reported."""
        lost = self.pending.rebooted(boot_ups)
        if lost:
            self.mark_unknown()
            self.pending.lost_until = len(self.history)
            self._unreported_losses += lost

    def plans_in_effect(self) -> list[Plan]:
        """The plans of this session still in effect, by the known resets, which clear unstored values.

        After a partial store nobody knows the stored plans: doubtful plans are listed.
        """
        pending, history = self.pending, self.history
        stored, since = history[: pending.stored_at], history[max(pending.stored_at, pending.lost_until) :]
        try:
            restarted = pending.boot_ups not in (None, self.bus.boot_ups(self.node_id))
        except BusUnavailable:
            restarted = False
        return stored if restarted and not pending.partly_stored else [*stored, *since]

    def undo(self, *, count: int = 1, force: bool = False, rolls_back: bool = False) -> Applied:
        """Undo the newest *count* plans in one transaction; with 1, the newest plan that still has an effect."""
        from dvtcli.device.change.undo_plan import UndoRequest

        plans = self.history[-count:] if count > 1 else self.history
        asked = UndoRequest(plans, everything=count > 1, force=force, own=True, rolls_back=rolls_back)
        applied, count = self.undo_plans(asked)
        self.was_undone(applied, count)
        return applied

    def was_undone(self, applied: Applied, count: int) -> None:
        """Record that *applied* undid the newest *count* plans of this session."""
        from dvtcli.device.store.unstored import mark_restored

        self.history, self.undid_own = self.history[: len(self.history) - count], True
        for _ in range(count):
            del self.change_order[
                max(number for number, change in enumerate(self.change_order) if change.node_id == self.node_id)
            ]
        if self.guard is not None:
            self.guard.history.drop_own(count, applied.plan)
        if len(self.history) < self.pending.stored_at:
            self.pending.partly_stored = True  # stored changes were undone: no number of changes matches
        if self.pending.is_as_stored(len(self.history)) and not (applied.findings or applied.not_put_back):
            self.pending.unstored.clear()  # the device holds what was stored, or found, again
        mark_restored(self, self.history, applied)

    def undo_plans(self, asked: UndoRequest) -> tuple[Applied, int]:
        """Undo the changes in *asked* and return the number of plans. Raises the errors of `plan_undo`."""

        from dvtcli.device.change.expected_refusals import foreseen, substitute_findings
        from dvtcli.device.change.undo_plan import plan_undo, undo_plan_of

        initial_state = self.begin_change(ignores_restarts=asked.rolls_back)
        boot_ups = self.bus.boot_ups(self.node_id)
        back = plan_undo(self, asked)
        if not asked.is_part_of_group and len(back.plan):
            self.known_pdos()  # including PDOs outside the plan, for side effects
            if self.bus.boot_ups(self.node_id) != boot_ups:
                back = plan_undo(self, asked)
        others = () if asked.is_part_of_group or not len(back.plan) else self._untouched(back.plan)
        try:
            applied = self._apply_undo(back.plan, back.unknown, initial_state, is_patient=bool(foreseen(back.undone)))
        except DeviceRefused:
            if not foreseen(back.undone) or self.bus.boot_ups(self.node_id) != initial_state.boot_ups:
                raise
            plan = self.observed(
                lambda: undo_plan_of(self, back.undone, with_substitutes=True, rolls_back=asked.rolls_back)
            )
            applied = self.apply(plan, back.unknown, remembered=False, initial_state=initial_state)
            applied = applied._replace(not_put_back=substitute_findings(foreseen(back.undone)))
        if others and self.bus.boot_ups(self.node_id) == boot_ups:  # otherwise the restart is reported: it cleared RAM
            self._roll_back_side_effects(applied.plan, others)
            if self.bus.boot_ups(self.node_id) != boot_ups:
                from dvtcli.device.change.apply_plan import read_changes_again

                read_changes_again(self, applied.plan, initial_state)
        self.undone_earlier += not asked.own
        return applied._replace(unrestored=back.unrestored), len(back.undone)

    def _untouched(self, plan: Plan) -> tuple[PdoChange, ...]:
        """The PDOs not written by *plan*, as last read, each as a change to its present values."""
        from dvtcli.device.change.untouched_pdos import as_they_are, untouched_pdos

        present = untouched_pdos(self, plan)
        return as_they_are({pdo: config for pdo, config in self.last_read.items() if pdo in present})

    def _roll_back_side_effects(self, plan: Plan, others: Sequence[PdoChange]) -> None:
        """Roll back side effects of the completed undo *plan* on *others*.

        Raises LeftChanged naming the PDOs still different.
        """
        from dvtcli.device.change.untouched_pdos import altered_of, others_left
        from dvtcli.domain.plan import PdoChange, Plan, plan_pdo

        boot_ups = self.bus.boot_ups(self.node_id)
        altered = self.observed(lambda: altered_of(self.sdo, others))
        if not altered or self.bus.boot_ups(self.node_id) != boot_ups:
            return
        try:
            back = (plan_pdo(change.pdo, self.pdo(change.pdo), change.before) for change in altered)
            self.apply(Plan(self.node_id, tuple(back)), remembered=False)
            own = [change for change in plan.changes if isinstance(change, PdoChange)]
            still = self.observed(lambda: altered_of(self.sdo, (*own, *others)))
        except DvtcliError as failed:
            raise others_left(plan, altered, failed) from failed
        if still:
            raise others_left(plan, still)

    def _apply_undo(
        self, plan: Plan, unknown: tuple[Finding, ...], initial_state: InitialState, *, is_patient: bool
    ) -> Applied:
        """Apply the undo *plan*; with *is_patient* a temporary refusal is retried, as in a roll-back."""
        from dvtcli.device.change.roll_back import PATIENCE_S, RETRY_S
        from dvtcli.domain.abort import may_pass

        deadline_s = self.bus.now_s() + (PATIENCE_S if is_patient else 0)
        while True:
            try:
                return self.apply(plan, unknown, remembered=False, initial_state=initial_state)
            except DeviceRefused as refused:
                passing = refused.abort is not None and may_pass(refused.abort)
                if not passing or self.bus.now_s() >= deadline_s:
                    raise
                self.bus.sleep(RETRY_S)


def _fitting(findings: Iterable[Finding], pdo: Pdo, want: AnyPdoRequest) -> Iterator[Finding]:
    """*findings* about *pdo*, with hints suited to the caller of *want*."""
    from dvtcli.domain.request import Cleared, Switched, hinting_at_set

    if not isinstance(want, Switched | Cleared):
        return iter(findings)
    return hinting_at_set(findings, pdo, enables=isinstance(want, Switched) and want.enabled)


def losses(nodes: Iterable[Node]) -> Iterator[str]:
    """A message for each node that restarted and lost changes since the last call."""
    for node in nodes:
        if lost := node.notice_reboot():
            yield f"node {node.node_id} restarted: unstored values are lost ({', '.join(lost)})"


def refuse_after_restarts(nodes: Iterable[Node]) -> None:
    """Raise Restarted if a node has lost changes of this script or command: its result does not hold."""
    for text in losses(nodes):
        raise Restarted(text, hint="check its supply, then repeat the command", state="unknown")

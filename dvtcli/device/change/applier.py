"""Apply checked plans to a node and record the changes and their loss by a restart."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.change.changeable import Changeable
from dvtcli.device.change.pending import COMMUNICATION, EVERYTHING
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import BusUnavailable

if TYPE_CHECKING:
    from dvtcli.device.applied import Applied
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.plan import Change, Plan, ValueChange
    from dvtcli.domain.rules import Finding


@dataclass(slots=True)
class Applier(Changeable):
    """A changeable node with the changes of this session."""

    #: applied plans for `undo`, oldest first
    history: list[Plan] = field(default_factory=list)
    #: node-IDs of this session's changes on all nodes, oldest first
    order: list[int] = field(default_factory=list)
    #: label -> change of this line kept by the node without a store
    kept_by_itself: dict[str, Change] = field(default_factory=dict)
    #: boot-up messages seen when the first of them was read back
    kept_boot_ups: int = 0
    #: commands of this session without a change, not yet reported by `undo`
    in_vain: int = 0
    #: labels of losses by a restart during a change, still to be reported
    _unsaid: tuple[str, ...] = ()

    def apply(
        self,
        plan: Plan,
        findings: tuple[Finding, ...] = (),
        *,
        force: bool = False,
        kept: bool = True,
        found: InitialState | None = None,
        is_part: bool = False,
    ) -> Applied:
        """Run a checked *plan* inside the gate; on a real bus with lock, backup and journal.

        With *kept*, `undo` can revert the plan. *found* is the result of `claim` before the reads that the plan is
        based on. *is_part* marks one of several plans, which end a configuration stamp themselves.
        """
        from dvtcli.device.access_level import level_findings
        from dvtcli.device.applied import Applied, refuse
        from dvtcli.device.change.retry import apply_with_retry
        from dvtcli.device.change.taken_back import with_way_back
        from dvtcli.domain.several import join_some

        self.answered_otherwise = {}
        if len(plan):
            plan, warnings = with_way_back(self, plan if is_part else self._with_stamp_ended(plan))
            locked = (*level_findings(self.access, plan), *(warnings if kept else ()))
            refuse(
                locked, f"{join_some(change.label for change in plan.changes)} not changed", self.node_id, force=force
            )
            findings += locked
            plan, findings = apply_with_retry(
                self,
                plan,
                findings,
                found,
                lambda carried_out, boot_ups: self._done(carried_out, boot_ups, kept=kept),
                is_kept=kept,
            )
            findings += self._unreadable_findings(plan)
        else:
            if found is not None and self.bus.upsets(self.node_id) != found.upsets:
                from dvtcli.device.change.apply_plan import look_again

                look_again(self, plan, found)
            self.in_vain += kept and not is_part
            self._remember(plan.changes)
        unreadable = tuple(finding.place.removeprefix("0x") for finding in self._unreadable_findings(plan))
        return Applied(plan, findings, unreadable=unreadable)

    def _unreadable_findings(self, plan: Plan) -> tuple[Finding, ...]:
        """A warning for each object that does not read back as written by *plan*."""
        if not (plan.unreadable or self.answered_otherwise):
            return ()
        from dvtcli.domain.plan import ValueChange
        from dvtcli.domain.rules.raw_write import unreadable_finding

        blind = [(change.step.index, change.step.sub_index) for change in plan.unreadable]
        return (
            *(unreadable_finding(*place) for place in blind),
            *(
                unreadable_finding(change.step.index, change.step.sub_index, self.answered_otherwise[change.label])
                for change in plan.changes
                if isinstance(change, ValueChange) and change.label in self.answered_otherwise
            ),
        )

    def _with_stamp_ended(self, plan: Plan) -> Plan:
        """*plan*, preceded by the removal of our stamp if the stamp covers a changed object."""
        from dvtcli.domain.plan import STAMP

        if self.has_no_stamp or (self.dictionary is not None and STAMP not in self.dictionary):
            return plan
        from dvtcli.device.stamped import with_stamp_ended

        return with_stamp_ended(self, plan)

    def _done(self, plan: Plan, boot_ups: int, *, kept: bool) -> None:
        """Record *plan* as verified after *boot_ups* boot-ups, before any later step can fail.

        These boot-ups cleared earlier changes, but nothing of the plan.
        """
        from dvtcli.device.change.after_change import set_words
        from dvtcli.domain.plan import alters

        self._heard(boot_ups)
        self.await_no_restart()
        self.gate.done.append(set_words(plan))
        saves = any(self.saves((step.index, step.sub_index)) for step in plan.steps)
        if kept and not saves and any(map(alters, plan.changes)):
            self.keep(plan)
        elif kept and not saves:
            self.in_vain += 1
        self._remember(plan.changes)
        needed = self.profile.store.needed_for
        by_itself = [change for change in plan.changes if change.steps and not needed(change.steps[0].index)]
        if by_itself and not self.kept_by_itself:
            self.kept_boot_ups = boot_ups
        readable = (change for change in by_itself if change.label not in self.answered_otherwise)
        self.kept_by_itself |= {change.label: change for change in readable}

    def require_kept(self) -> None:
        """Read this line's changes that need no store again if the node restarted since the read-back.

        Raises Restarted if the node has lost them: nothing else reports the loss.
        """
        changes = tuple(self.kept_by_itself.values())
        try:
            if not changes or self.bus.boot_ups(self.node_id) == self.kept_boot_ups:
                return
        except BusUnavailable:
            return  # as for `notice_reboot`
        from dvtcli.device.change.apply_plan import look_again
        from dvtcli.domain.plan import Plan

        look_again(self, Plan(self.node_id, changes), None, "restarted after it was changed")

    def keep(self, plan: Plan) -> None:
        """Record the completed *plan* for undo, by this session and on a real bus by later sessions."""
        self.history.append(plan)
        self.order.append(self.node_id)
        if self.keeper is not None:
            self.keeper.remember(plan)

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
            if change.label not in self.answered_otherwise:
                self.expected.changed(change)
            if isinstance(change, PdoChange):
                self.wanted[change.pdo] = self._shown[change.pdo] = change.after
            elif Pdo.at(change.step.index) is None:
                self._remember_value(change)
            if any(self.saves((step.index, step.sub_index)) for step in change.steps):
                from dvtcli.device.storing import mark_stored

                mark_stored(self, self.pending.was_stored(EVERYTHING, len(self.history)))
            elif alters(change) and self.profile.store.needed_for(change.steps[0].index):
                self.pending.changed(change.label, change.steps[0].index)

    def _remember_value(self, change: ValueChange) -> None:
        """Record the value of a single write for `verify`; an unreadable object is only named there."""
        place = change.step.index, change.step.sub_index
        if self.saves(place):
            return
        kept, other = self.wanted_values, self.unreadable_values
        if not change.is_readable or change.label in self.answered_otherwise:
            kept, other = other, kept
        kept[place] = change.step.after
        other.pop(place, None)

    def was_reset(self, *, communication: bool) -> tuple[str, ...]:
        """Record a requested reset and return the labels of lost changes.

        *communication*: only communication objects were reset.
        """
        self.mark_unknown()
        self.kept_by_itself.clear()
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
        self._heard(boot_ups)
        lost, self._unsaid = self._unsaid, ()
        return lost

    def _heard(self, boot_ups: int) -> None:
        """Record *boot_ups* boot-ups; the losses of the latest are still to be reported."""
        lost = self.pending.rebooted(boot_ups)
        if lost:
            self.mark_unknown()
            self.pending.lost_until = len(self.history)
            self._unsaid += lost

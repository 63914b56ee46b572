"""One node as a command sees it: its PDOs, what was changed, and the way to change it.

Joins reading, rules, plan and transaction; what only a change needs is imported by it. Does not print, ask, or know
what a file or an option is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.change.changeable import Changeable
from dvtcli.device.change.pending import COMMUNICATION, EVERYTHING
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import BusUnavailable, DeviceRefused, UsageError

if TYPE_CHECKING:
    from dvtcli.device.applied import Applied
    from dvtcli.device.change.way_back import WayBack
    from dvtcli.device.observe import Found
    from dvtcli.domain.plan import Change, Plan, Step
    from dvtcli.domain.request import PdoWant
    from dvtcli.domain.rules import Finding


@dataclass(slots=True)
class Node(Changeable):
    """A node with what this session did to it, and the way to change it and to undo that."""

    #: plans that were applied, oldest first: what `undo` puts back
    history: list[Plan] = field(default_factory=list)
    #: node-IDs of this session's changes on all its nodes, oldest first
    order: list[int] = field(default_factory=list)
    #: how the device differs from the one that its file is about; empty where it does not
    unlike_file: str = ""
    #: how many changes were put back that were none of this session's
    unkept: int = 0
    #: labels of what a restart was seen to take while a change was made, which is yet to be said
    _unsaid: tuple[str, ...] = ()

    def configure(self, wants: Mapping[Pdo, PdoWant], *, force: bool = False, found: Found | None = None) -> Applied:
        """Make each PDO what *wants* says, all or none: check, write the least, read back, else put the old back.

        *found* is how the node was claimed, where it was for this already: what was read since then counts.
        Raises as `resolve` where a want comes to nothing on this node, RuleError where a rule forbids it.
        """
        from dvtcli.device.applied import refuse
        from dvtcli.device.file_fits import refuse_unlike_file
        from dvtcli.device.proposal import proposal
        from dvtcli.device.resolve import resolve, untyped_lengths
        from dvtcli.domain.plan import Plan, plan_pdo
        from dvtcli.domain.request import said_by
        from dvtcli.domain.rules import check_pdo
        from dvtcli.domain.several import several

        refuse_unlike_file(self.node_id, self.unlike_file, force=force)
        look = self.pdo if found is None else self.known_pdo
        found = found or self.claim()
        lengths = untyped_lengths(self, wants.values())
        now = self.observed(lambda: {pdo: look(pdo) for pdo in wants})  # what is so already is not looked at again
        wanted = {pdo: resolve(self, pdo, now[pdo], want, lengths) for pdo, want in wants.items()}
        findings: list[Finding] = []
        for pdo, want in wanted.items():
            if now[pdo] != want or not want.has_cob_id:  # nobody knows whether that is so already
                findings += check_pdo(proposal(self, pdo, now[pdo], want, wanted))
        labels = several(pdo.label for pdo in wanted)
        # with nothing to write, force would only make of "nobody knows" that it is so
        can_force = all(now[pdo] != want or want.has_cob_id for pdo, want in wanted.items())
        refuse(tuple(findings), f"{labels} not changed", self.node_id, force=force, can_force=can_force)
        changes = tuple(plan_pdo(pdo, now[pdo], want) for pdo, want in wanted.items())
        applied = self.apply(Plan(self.node_id, changes), tuple(findings), force=force, found=found)
        for pdo, asked in wants.items():
            self._say(pdo, said_by(asked))
        return applied

    def write(self, index: int, sub_index: int, data: bytes, *, force: bool = False) -> Applied:
        """Write one object as a plan of one step, under the rules of the command that is meant for it."""
        from dvtcli.device.access_level import refuse_passcode
        from dvtcli.device.applied import refuse
        from dvtcli.device.file_fits import refuse_unlike_file
        from dvtcli.device.raw_write_check import held_value, raw_change, raw_write_findings
        from dvtcli.device.storing import prepare_store
        from dvtcli.domain.plan import PdoChange, Plan, Step
        from dvtcli.domain.request import said_at

        refuse_passcode(self.access, index, sub_index)
        refuse_unlike_file(self.node_id, self.unlike_file, force=force)
        found = self.claim()
        if self.saves((index, sub_index)):
            prepare_store(self, force=force)
        findings = raw_write_findings(self, index, sub_index, data)
        refuse(findings, f"0x{index:04X}:{sub_index:02X} not written", self.node_id, force=force)
        change = raw_change(self, Step(index, sub_index, held_value(self, index, sub_index), data, "write"))
        applied = self.apply(Plan(self.node_id, (change,)), findings, force=force, found=found)
        if isinstance(change, PdoChange):
            self._say(change.pdo, said_at(change.pdo, index, sub_index))
        return applied

    def _say(self, pdo: Pdo, parameters: frozenset[str]) -> None:
        self.said[pdo] = self.said.get(pdo, frozenset()) | parameters

    def go_on_from(self, before: Node) -> None:
        """Be the same device as *before*, met anew: what this session did to it counts, nothing that was read of it."""
        self.history, self.unkept, self.said = before.history, before.unkept, before.said
        self.wanted, self.wanted_values = before.wanted, before.wanted_values
        self.pending, self.expected = before.pending, before.expected

    def look_after_gap(self) -> tuple[str, ...]:
        """Nobody listened for a while: what it does not hold any more of what was set and not stored, as labels."""
        from dvtcli.device.wish import Wish, unlike

        pdos = {pdo: config for pdo, config in self.wanted.items() if pdo.label in self.unstored}
        values = {at: data for at, data in self.wanted_values.items() if f"{at[0]:04X}:{at[1]:02X}" in self.unstored}
        lost = tuple(dict.fromkeys(label for label, _ in unlike(self, Wish(pdos, values))))
        if lost:
            self.pending.lost(lost)
            self.pending.lost_until = len(self.history)
        return lost

    def undo(self, *, everything: bool = False, force: bool = False, rolls_back: bool = False) -> Applied:
        """Put back what the last plan replaced, or all of them, in one transaction."""
        applied, count = self.put_back(
            self.history, everything=everything, force=force, own=True, rolls_back=rolls_back
        )
        self.was_undone(applied, count)
        return applied

    def was_undone(self, applied: Applied, count: int) -> None:
        """*applied* put back what the newest *count* plans of this session had left."""
        self.history = self.history[: len(self.history) - count]
        for _ in range(count):
            del self.order[max(number for number, node_id in enumerate(self.order) if node_id == self.node_id)]
        if self.keeper is not None:
            self.keeper.past.forget_own(count, applied.plan)
        if self.pending.is_as_stored(len(self.history)) and not (applied.findings or applied.not_put_back):
            self.pending.unstored.clear()  # the device holds what was stored, or found, again

    def put_back(
        self,
        plans: Sequence[Plan],
        *,
        everything: bool = False,
        force: bool = False,
        own: bool = False,
        rolls_back: bool = False,
    ) -> tuple[Applied, int]:
        """Put back what the newest of *plans* (oldest first) replaced, or *everything* of them; and how many that were.

        These are more than one also where the device has lost the newest ones, as after a reset. *own* says that they
        are of this session's history. SafetyRefusal where the device holds something else by now, UsageError where
        nobody knows what it held before; with *force* neither. *rolls_back* says that nothing was stored since.
        """
        from dataclasses import replace

        from dvtcli.device.change.taken_back import foreseen, put_back_findings
        from dvtcli.device.change.way_back import plan_back

        found = self.claim()
        back = self.way_back(plans, everything=everything, force=force, own=own, rolls_back=rolls_back)
        try:
            applied = self._apply_back(back.plan, back.unknown, found, is_patient=bool(foreseen(back.undone)))
        except DeviceRefused:
            if not foreseen(back.undone) or self.bus.boot_ups(self.node_id) != found.boot_ups:
                raise
            plan = self.observed(lambda: plan_back(self, back.undone, as_taken=True, rolls_back=rolls_back))
            applied = self.apply(plan, back.unknown, kept=False)
            applied = replace(applied, not_put_back=put_back_findings(foreseen(back.undone)))
        self.unkept += not own
        return applied, len(back.undone)

    def way_back(
        self,
        plans: Sequence[Plan],
        *,
        everything: bool = False,
        force: bool = False,
        own: bool = False,
        rolls_back: bool = False,
    ) -> WayBack:
        """The way back that `put_back` takes, of a node that is claimed; raises as that does, and writes nothing."""
        from dvtcli.device.change.gap import unbroken
        from dvtcli.device.change.way_back import WayBack, plan_back, refuse_unless_left, unknown_before

        chain = plans if own else unbroken(plans)
        count = len(chain) if everything else 1
        if not force:
            count = refuse_unless_left(self, chain, count)
        undone = chain[-count:]
        plan = self.observed(lambda: plan_back(self, undone, rolls_back=rolls_back))
        unknown = unknown_before(undone)
        if unknown and not plan.changes and not force:
            raise UsageError(
                unknown[0].text, node=self.node_id, hint="undo --force leaves it so and forgets that change"
            )
        return WayBack(plan, tuple(undone), unknown)

    def _apply_back(self, plan: Plan, unknown: tuple[Finding, ...], found: Found, *, is_patient: bool) -> Applied:
        """Apply *plan*, the way back; with *is_patient* a refusal that may pass is waited for, as a roll-back does."""
        from dvtcli.device.change.put_back import PATIENCE_S, RETRY_S
        from dvtcli.domain.abort import may_pass

        deadline_s = self.bus.now_s() + (PATIENCE_S if is_patient else 0)
        while True:
            try:
                return self.apply(plan, unknown, kept=False, found=found)
            except DeviceRefused as refused:
                passing = refused.abort is not None and may_pass(refused.abort)
                if not passing or self.bus.now_s() >= deadline_s:
                    raise
                self.bus.sleep(RETRY_S)

    def was_reset(self, *, communication: bool) -> tuple[str, ...]:
        """A reset that was asked for has happened (*communication*: of the communication objects only).

        Returns the labels of what is lost.
        """
        self.is_unknown_now()
        self.expected.clear()
        self.pending.lost_until = len(self.history)
        return self.pending.was_reset(COMMUNICATION if communication else EVERYTHING, self.bus.boot_ups(self.node_id))

    def notice_reboot(self) -> tuple[str, ...]:
        """Labels of unstored changes that a restart nobody asked for has lost; empty where there was none."""
        try:
            boot_ups = self.bus.boot_ups(self.node_id)
        except BusUnavailable:
            return ()  # a dead bus tells nothing, and whoever needs it says so
        self._heard(boot_ups)
        lost, self._unsaid = self._unsaid, ()
        return lost

    def _heard(self, boot_ups: int) -> None:
        """So many boot-ups were seen by now: what the last ones took is to be said."""
        lost = self.pending.rebooted(boot_ups)
        if lost:
            self.is_unknown_now()
            self.pending.lost_until = len(self.history)
            self._unsaid += lost

    def apply(
        self,
        plan: Plan,
        findings: tuple[Finding, ...] = (),
        *,
        force: bool = False,
        kept: bool = True,
        found: Found | None = None,
        is_part: bool = False,
    ) -> Applied:
        """Run a checked *plan* inside the gate; on a real bus with lock, backup and journal.

        With *kept* it is remembered, so that `undo` can put it back. *found* is what `claim` answered before the reads
        that the plan was made from. *is_part* says that it is one of several, which end a stamp by themselves.
        """
        from dvtcli.device.access_level import level_findings
        from dvtcli.device.applied import Applied, refuse
        from dvtcli.device.change.taken_back import with_way_back
        from dvtcli.device.second_try import carry_out_as_taken
        from dvtcli.domain.several import several

        if len(plan):
            plan, warnings = with_way_back(self, plan if is_part else self._with_stamp_ended(plan))
            locked = (*level_findings(self.access, plan), *(warnings if kept else ()))
            refuse(locked, f"{several(change.label for change in plan.changes)} not changed", self.node_id, force=force)
            findings += locked
            plan, findings = carry_out_as_taken(
                self, plan, findings, found, lambda one, boot_ups: self._done(one, boot_ups, kept=kept)
            )
        else:
            if found is not None and self.bus.upsets(self.node_id) != found.upsets:
                from dvtcli.device.change.carry_out import look_again

                look_again(self, plan, found)
            self._remember(plan.changes)
        return Applied(plan, findings)

    def _with_stamp_ended(self, plan: Plan) -> Plan:
        """*plan*, ahead of which a stamp of ours goes that vouches for what it changes."""
        from dvtcli.domain.plan import STAMP

        if self.has_no_stamp or (self.dictionary is not None and STAMP not in self.dictionary):
            return plan
        from dvtcli.device.stamped import with_stamp_ended

        return with_stamp_ended(self, plan)

    def _done(self, plan: Plan, boot_ups: int, *, kept: bool) -> None:
        """*plan* was carried out, and read back after *boot_ups* boot-ups: whatever fails from here on, it is so.

        Those took what was set before it, and nothing of the plan.
        """
        from dvtcli.domain.plan import alters
        from dvtcli.domain.several import several

        self._heard(boot_ups)
        self.gate.done.append(f"{several(change.label for change in plan.changes)} was set and read back equal")
        saves = any(self.saves((step.index, step.sub_index)) for step in plan.steps)
        if kept and not saves and any(map(alters, plan.changes)):
            self.keep(plan)
        self._remember(plan.changes)

    def keep(self, plan: Plan) -> None:
        """*plan* was carried out and can be undone, by this session and on a real bus by a later one."""
        self.history.append(plan)
        self.order.append(self.node_id)
        if self.keeper is not None:
            self.keeper.remember(plan)

    def saves(self, place: tuple[int, int]) -> bool:
        """Whether a write to *place* is how this family keeps its settings: nothing that could be undone."""
        return place == self.profile.store.saved_by

    @property
    def unstored(self) -> dict[str, int]:
        """Labels of what changed since the last store, in order, each with its index."""
        return self.pending.unstored

    def _remember(self, changes: tuple[Change, ...]) -> None:
        from dvtcli.domain.plan import PdoChange, alters

        for change in changes:
            self.expected.changed(change)
            if isinstance(change, PdoChange):
                self.wanted[change.pdo] = self._shown[change.pdo] = change.after
            elif self._is_kept(change.step):
                self.wanted_values[change.step.index, change.step.sub_index] = change.step.after
            if any(self.saves((step.index, step.sub_index)) for step in change.steps):
                from dvtcli.device.storing import is_stored

                is_stored(self, self.pending.was_stored(EVERYTHING, len(self.history)))
            elif alters(change) and self.profile.store.needed_for(change.steps[0].index):
                self.pending.changed(change.label, change.steps[0].index)

    def _is_kept(self, step: Step) -> bool:
        """Whether what a single write left can be compared: not write-only, no way to save, no part of a PDO."""
        return step.before is not None and Pdo.at(step.index) is None and not self.saves((step.index, step.sub_index))

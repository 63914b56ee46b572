"""One node for a command: its PDOs, its changes, and the means to change it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.device.change.applier import Applier
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import DeviceRefused, DvtcliError

if TYPE_CHECKING:
    from dvtcli.device.applied import Applied
    from dvtcli.device.change.way_back import TakeBack
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.plan import PdoChange, Plan
    from dvtcli.domain.request import PdoWant
    from dvtcli.domain.rules import Finding


@dataclass(slots=True)
class Node(Applier):
    """A node to configure, write and undo."""

    #: the difference between the device and its file; empty if none
    unlike_file: str = ""
    #: undone changes of earlier sessions
    unkept: int = 0

    def configure(
        self, wants: Mapping[Pdo, PdoWant], *, force: bool = False, found: InitialState | None = None
    ) -> Applied:
        """Set each PDO to *wants*, all or none: check, write the differences, read back, roll back on failure.

        *found* is the initial state if the node was claimed before: reads since then count. Raises errors of `resolve`
        for a request impossible on this node, RuleError if a rule forbids the change.
        """
        from dvtcli.device.applied import refuse
        from dvtcli.device.file_fits import refuse_unlike_file
        from dvtcli.device.heard_producers import heard_ids, heard_producer_findings
        from dvtcli.device.proposal import proposal
        from dvtcli.device.resolve import resolve, untyped_lengths
        from dvtcli.domain.plan import Plan, plan_pdo
        from dvtcli.domain.request import instead_findings, said_by
        from dvtcli.domain.rules import check_pdo
        from dvtcli.domain.several import join_some

        refuse_unlike_file(self.node_id, self.unlike_file, force=force)
        look = self.pdo if found is None else self.known_pdo
        with heard_ids(self.bus) as heard:
            found = found or self.begin_change()
            lengths = untyped_lengths(self, wants.values())
            now = self.observed(lambda: {pdo: look(pdo) for pdo in wants})  # equal PDOs are not read again
            wanted = {pdo: resolve(self, pdo, now[pdo], want, lengths) for pdo, want in wants.items()}
            changes_of = {pdo: (now[pdo], want) for pdo, want in wanted.items()}
            findings: list[Finding] = []
            for pdo, change in changes_of.items():
                findings += _fitting(heard_producer_findings(self, {pdo: change}, heard), pdo, wants[pdo])
        for pdo, want in wanted.items():
            if now[pdo] != want or not want.has_cob_id:  # the present state is unknown
                proposed = proposal(self, pdo, now[pdo], want, wanted)
                judged = (*instead_findings(wants[pdo], proposed), *check_pdo(proposed))
                findings += _fitting(judged, pdo, wants[pdo])
        labels = join_some(pdo.label for pdo in wanted)
        # with nothing to write, force would only turn "unknown" into "equal"
        can_force = all(now[pdo] != want or want.has_cob_id for pdo, want in wanted.items())
        refuse(tuple(findings), f"{labels} not changed", self.node_id, force=force, can_force=can_force)
        changes = tuple(plan_pdo(pdo, now[pdo], want) for pdo, want in wanted.items())
        applied = self.apply(Plan(self.node_id, changes), tuple(findings), force=force, found=found)
        for pdo, asked in wants.items():
            self._say(pdo, said_by(asked))
        return applied

    def write(self, index: int, sub_index: int, data: bytes, *, force: bool = False) -> Applied:
        """Write one object as a plan of one step, under the rules of the matching command."""
        from dvtcli.device.access_level import refuse_passcode
        from dvtcli.device.applied import refuse
        from dvtcli.device.file_fits import refuse_unlike_file
        from dvtcli.device.heard_producers import heard_ids, heard_producer_findings
        from dvtcli.device.raw_write_check import held_value, raw_change, raw_write_findings, taken_can_id_findings
        from dvtcli.device.storing import prepare_store
        from dvtcli.domain.plan import PdoChange, Plan, Step
        from dvtcli.domain.request import hinting_at_set, said_at

        refuse_passcode(self.access, index, sub_index)
        refuse_unlike_file(self.node_id, self.unlike_file, force=force)
        found = self.begin_change()
        if self.saves((index, sub_index)):
            prepare_store(self, force=force)
        what = f"0x{index:04X}:{sub_index:02X} not written"
        with heard_ids(self.bus) as heard:
            findings = raw_write_findings(self, index, sub_index, data)
            if (pdo := Pdo.at(index)) is not None:
                findings = tuple(hinting_at_set(findings, pdo, enables=False))
            findings = (*findings, *taken_can_id_findings(self, index, sub_index, data))
            refuse(findings, what, self.node_id, force=force)
            change = raw_change(self, Step(index, sub_index, held_value(self, index, sub_index), data, "write"))
            if isinstance(change, PdoChange):
                changes = {change.pdo: (change.before, change.after)}
                heard_findings = heard_producer_findings(self, changes, heard)
                findings = (*findings, *hinting_at_set(heard_findings, change.pdo, enables=False))
                refuse(findings, what, self.node_id, force=force)
        applied = self.apply(Plan(self.node_id, (change,)), findings, force=force, found=found)
        if isinstance(change, PdoChange):
            self._say(change.pdo, said_at(change.pdo, index, sub_index))
        return applied

    def _say(self, pdo: Pdo, parameters: frozenset[str]) -> None:
        self.said[pdo] = self.said.get(pdo, frozenset()) | parameters

    def go_on_from(self, before: Node) -> None:
        """Continue as the device *before*, opened again: keep this session's changes, discard all reads."""
        self.history, self.unkept, self.said = before.history, before.unkept, before.said
        self.wanted, self.wanted_values = before.wanted, before.wanted_values
        self.unreadable_values = before.unreadable_values
        self.in_vain = before.in_vain
        self.pending, self.expected = before.pending, before.expected

    def look_after_gap(self) -> tuple[str, ...]:
        """After a gap in monitoring: labels of unstored changes that the node has lost."""
        from dvtcli.device.wish import Wish, unlike

        pdos = {pdo: config for pdo, config in self.wanted.items() if pdo.label in self.unstored}
        values = {at: data for at, data in self.wanted_values.items() if f"{at[0]:04X}:{at[1]:02X}" in self.unstored}
        lost = tuple(dict.fromkeys(label for label, _ in unlike(self, Wish(pdos, values))))
        if lost:
            self.pending.lost(lost)
            self.pending.lost_until = len(self.history)
        return lost

    def undo(self, *, everything: bool = False, force: bool = False, rolls_back: bool = False) -> Applied:
        """Undo the last plan, or all plans, in one transaction."""
        from dvtcli.device.change.way_back import TakeBack

        asked = TakeBack(self.history, everything=everything, force=force, own=True, rolls_back=rolls_back)
        applied, count = self.put_back(asked)
        self.was_undone(applied, count)
        return applied

    def was_undone(self, applied: Applied, count: int) -> None:
        """Record that *applied* undid the newest *count* plans of this session."""
        self.history = self.history[: len(self.history) - count]
        for _ in range(count):
            del self.order[max(number for number, node_id in enumerate(self.order) if node_id == self.node_id)]
        if self.keeper is not None:
            self.keeper.past.forget_own(count, applied.plan)
        if len(self.history) < self.pending.stored_at:
            self.pending.partly_stored = True  # stored changes were undone: no number of changes matches
        if self.pending.is_as_stored(len(self.history)) and not (applied.findings or applied.not_put_back):
            self.pending.unstored.clear()  # the device holds what was stored, or found, again

    def put_back(self, asked: TakeBack) -> tuple[Applied, int]:
        """Undo the changes in *asked* and return the number of plans. Raises the errors of `way_back`."""
        from dataclasses import replace

        from dvtcli.device.change.taken_back import foreseen, put_back_findings
        from dvtcli.device.change.way_back import plan_back, way_back

        found = self.begin_change(whatever_happened=asked.rolls_back)
        boot_ups = self.bus.boot_ups(self.node_id)
        back = way_back(self, asked)
        if not asked.is_part and len(back.plan):
            self.known_pdos()  # including PDOs outside the plan, for side effects
            if self.bus.boot_ups(self.node_id) != boot_ups:
                back = way_back(self, asked)
        others = () if asked.is_part or not len(back.plan) else self._beside(back.plan)
        try:
            applied = self._apply_back(back.plan, back.unknown, found, is_patient=bool(foreseen(back.undone)))
        except DeviceRefused:
            if not foreseen(back.undone) or self.bus.boot_ups(self.node_id) != found.boot_ups:
                raise
            plan = self.observed(lambda: plan_back(self, back.undone, as_taken=True, rolls_back=asked.rolls_back))
            applied = self.apply(plan, back.unknown, kept=False, found=found)
            applied = replace(applied, not_put_back=put_back_findings(foreseen(back.undone)))
        if others and self.bus.boot_ups(self.node_id) == boot_ups:  # otherwise the restart is reported: it cleared RAM
            self._put_others_back(applied.plan, others)
            if self.bus.boot_ups(self.node_id) != boot_ups:
                from dvtcli.device.change.apply_plan import look_again

                look_again(self, applied.plan, found)
        self.unkept += not asked.own
        return replace(applied, unrestored=back.unrestored), len(back.undone)

    def _beside(self, plan: Plan) -> tuple[PdoChange, ...]:
        """The PDOs not written by *plan*, as last read, each as a change to its present values."""
        from dvtcli.device.change.untouched_pdos import as_they_are, present_beside

        present = present_beside(self, plan)
        return as_they_are({pdo: config for pdo, config in self.last_read.items() if pdo in present})

    def _put_others_back(self, plan: Plan, others: Sequence[PdoChange]) -> None:
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
            self.apply(Plan(self.node_id, tuple(back)), kept=False)
            own = [change for change in plan.changes if isinstance(change, PdoChange)]
            still = self.observed(lambda: altered_of(self.sdo, (*own, *others)))
        except DvtcliError as failed:
            raise others_left(plan, altered, failed) from failed
        if still:
            raise others_left(plan, still)

    def _apply_back(
        self, plan: Plan, unknown: tuple[Finding, ...], found: InitialState, *, is_patient: bool
    ) -> Applied:
        """Apply the undo *plan*; with *is_patient* a temporary refusal is retried, as in a roll-back."""
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


def _fitting(findings: Iterable[Finding], pdo: Pdo, want: PdoWant) -> Iterator[Finding]:
    """*findings* about *pdo*, with hints suited to the caller of *want*."""
    from dvtcli.domain.request import Cleared, Switched, hinting_at_set

    if not isinstance(want, Switched | Cleared):
        return iter(findings)
    return hinting_at_set(findings, pdo, enables=isinstance(want, Switched) and want.enabled)

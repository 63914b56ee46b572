"""What must be rolled back on one node: the plans of a change group, joined into one."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from dvtcli.device.change.change_group import ChangeGroup, GroupMember
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Change, PdoChange, Plan, ValueChange


@dataclass(slots=True)
class ChangesToRollBack:
    """The changes of one node that its journal can roll back: verified plans of a group and the plan *in_hand*.

    *nmt_state* is the NMT state before the first plan.
    """

    nmt_state: int | None = None
    member: GroupMember = field(default_factory=GroupMember)
    made: list[Plan] = field(default_factory=list)
    in_hand: Plan | None = None
    #: the whole plan, if its journal is on disk before the first write; None: each change by itself
    prepared: Plan | None = None

    def begin(
        self,
        group: ChangeGroup,
        plan: Plan,
        nmt_state: int | None,
        asked: tuple[str, ...] = (),
        *,
        is_test: bool = False,
    ) -> str:
        """Add *plan*, about to be applied or probed by `learn`, and return its id for `undo`.

        With *is_test* the plan is temporary, until `end_test`.
        """
        if self.member.group_id != group.id or not self.is_begun:
            self.made, self.nmt_state, self.member = [], nmt_state, GroupMember(group.id, group.name)
        entry, tests = os.urandom(16).hex(), plan.changes if is_test else ()
        self.member = self.member._replace(entries=(*self.member.entries, entry), asked=asked, tests=tests)
        self.in_hand = plan
        return entry

    @property
    def is_begun(self) -> bool:
        """True if the journal has verified changes to roll back, or the prepared change of a group."""
        return bool(self.made) or self.prepared is not None

    def prepare(self, group: ChangeGroup, plan: Plan, nmt_state: int | None) -> str:
        """Add the whole *plan* of a group, applied in parts, and return its id for `undo`."""
        entry = self.begin(group, plan, nmt_state)
        self.in_hand, self.prepared = None, combine_plans(plan.node_id, [*self.made, plan])
        return entry

    def carried_out(self) -> None:
        """Mark the plan in progress as verified; in a group it stays for a roll-back with later changes."""
        if self.member.group_id is not None and self.in_hand is not None:
            self.made.append(self.in_hand)
            self.in_hand = None

    def end_test(self) -> None:
        """Drop the temporary change of a proof after its roll-back."""
        if self.member.tests:
            self.made = [plan for plan in self.made if plan.changes != self.member.tests]
            self.member = self.member._replace(tests=())

    @property
    def plan(self) -> Plan:
        """Everything to roll back, as one plan."""
        plans = [plan for plan in (self.prepared, *self.made, self.in_hand) if plan is not None]
        return plans[0] if len(plans) == 1 else combine_plans(plans[0].node_id, plans)


def covers(kept: Plan, plan: Plan) -> bool:
    """True if rolling back *kept* rolls back all of *plan*: the same objects with the same former values."""
    held = {_key(change): _before(change) for change in kept.changes}
    return all(held.get(_key(change)) == _before(change) for change in plan.changes)


def _before(change: Change) -> object:
    return (change.before, change.substitute) if isinstance(change, PdoChange) else change.step.before


def _key(change: Change) -> object:
    return change.pdo if isinstance(change, PdoChange) else change.label


def combine_plans(node_id: int, plans: Iterable[Plan]) -> Plan:
    """One plan from before the first of *plans* to after the last, rolled back in reverse order.

    Rolling back a whole PDO replaces earlier writes to its objects, except a mapping entry behind the count of an empty
    mapping: the entry is rolled back after the PDO, which makes room.
    """
    first: dict[object, Change] = {}
    last: dict[object, Change] = {}
    for change in (change for plan in plans for change in plan.changes):
        first.setdefault(_key(change), change)
        last[_key(change)] = change
    pdos = {change.pdo: change for change in first.values() if isinstance(change, PdoChange)}
    joined = [_joined(change, last[key]) for key, change in first.items() if _counts(change, pdos)]
    fillers = [change for change in joined if _is_in(change, pdos)]
    return Plan(node_id, (*fillers, *(change for change in joined if not _is_in(change, pdos))))


def _is_in(change: Change, pdos: dict[Pdo, PdoChange]) -> bool:
    return isinstance(change, ValueChange) and Pdo.at(change.step.index) in pdos


def _counts(change: Change, pdos: dict[Pdo, PdoChange]) -> bool:
    if not isinstance(change, ValueChange) or not _is_in(change, pdos):
        return True
    pdo = Pdo.at(change.step.index)
    assert pdo is not None  # noqa: S101 - it is one of theirs
    before = pdos[pdo].before
    entry = change.step.index == pdo.mapping_index and change.step.sub_index > 0
    return entry and not before.enabled and before.count == 0


def _joined(first: Change, last: Change) -> Change:
    if isinstance(first, PdoChange):
        assert isinstance(last, PdoChange)  # noqa: S101 - one key, one kind
        return last._replace(before=first.before, substitute=first.substitute)
    assert isinstance(last, ValueChange)  # noqa: S101
    return ValueChange(replace(last.step, before=first.step.before))

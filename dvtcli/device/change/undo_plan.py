"""The plan that undoes a plan, for `undo` and `recover`, and the values that a node will refuse then."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.change.change_guard import who_else
from dvtcli.device.stamped import is_stamp, stamp_back
from dvtcli.device.target_config import TargetConfig, config_differences, differences
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.objects import VERIFY_CONFIGURATION
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, ValueChange, altering, plan_pdo
from dvtcli.domain.rules.finding import Finding, warning
from dvtcli.domain.rules.raw_write import why_unreadable
from dvtcli.domain.store import DATE, TIME, is_own_date
from dvtcli.domain.text import join_some, value_text
from dvtcli.errors import SafetyRefusal, SdoAborted, UsageError

if TYPE_CHECKING:
    from dvtcli.device.change.changeable import Changeable
    from dvtcli.device.known_pdos import KnownPdos
    from dvtcli.device.node_parts import ReadableNode


def refuse_gap(node: Changeable, plans: Sequence[Plan]) -> None:
    """Raise SafetyRefusal if another writer changed a value between two of *plans*."""
    found = _gap(plans)
    if found is not None:
        raise _refusal(node, *found)


def unbroken(plans: Sequence[Plan]) -> Sequence[Plan]:
    """The newest of *plans* (oldest first) without a foreign change between them."""
    return next((plans[first:] for first in range(len(plans)) if _gap(plans[first:]) is None), ())


def _gap(plans: Sequence[Plan]) -> tuple[str, str] | None:
    """A foreign change between two of *plans*: the object and the difference."""
    pdos: dict[Pdo, list[PdoConfig]] = {}
    values: dict[tuple[int, int], list[bytes]] = {}
    for change in (change for plan in plans for change in plan.changes):
        if isinstance(change, PdoChange):
            known = pdos.setdefault(change.pdo, [change.before])
            if change.before not in known:
                return change.label, join_some(differences(change.pdo, known[-1], change.before))
            known += [change.before, change.after]
        elif (pdo := Pdo.at(change.step.index)) is not None:
            pdos.pop(pdo, None)  # a part of it was written: the next plan finds another whole
        elif (before := change.step.before) is not None:
            held = values.setdefault((change.step.index, change.step.sub_index), [before])
            if before not in held:
                return change.label, f"was {value_text(held[-1])}, became {value_text(before)}"
            held += [before, change.step.after]
    return None


def _refusal(node: Changeable, label: str, why: str) -> SafetyRefusal:
    return SafetyRefusal(
        f"somebody else changed {label} of node {node.node_id} between this session's changes",
        node=node.node_id,
        why=why,
        hint=Hint(Action.UNDO, why=f"{verbatim(who_else(node.guard))}: {{}} reverts the later changes")
        + Hint(Action.UNDO, {"all": True, "force": True}, ", {} everything"),
    )


@dataclass(frozen=True, slots=True)
class UndoRequest:
    """The changes to undo: the newest of *plans* (oldest first), or *everything*.

    *own*: the plans are of this session's history; *rolls_back*: nothing was stored since. With *force* present values
    of the device do not matter. With *is_part_of_group* the undo has further parts;
    the last one compares the untouched PDOs.
    """

    plans: Sequence[Plan]
    _: KW_ONLY
    everything: bool = False
    force: bool = False
    own: bool = False
    rolls_back: bool = False
    is_part_of_group: bool = False


class UndoPlan(NamedTuple):
    """The *plan* from a node's present values to the values before the plans *undone* (oldest first).

    *unknown* warns of objects that stay because their former value is unknown.
    """

    plan: Plan
    undone: tuple[Plan, ...]
    unknown: tuple[Finding, ...]

    @property
    def unrestored(self) -> tuple[str, ...]:
        """The objects in *unknown*, as `2050:00`."""
        return unrestored_objects(self.unknown)


def plan_undo(node: Changeable, asked: UndoRequest) -> UndoPlan:
    """Plan the undo on the claimed *node*; writes nothing.

    Also works if the device has lost the newest plans, as after a reset. Raises SafetyRefusal if the device has other
    values by now, UsageError if the former values are unknown; with force neither.
    """
    chain = asked.plans if asked.own else unbroken(asked.plans)
    count = len(chain) if asked.everything else 1
    if not asked.force:
        count = refuse_unless_left(node, chain, count)
    undone = chain[-count:]
    plan = node.observed(lambda: undo_plan_of(node, undone, rolls_back=asked.rolls_back))
    undo_plan = UndoPlan(plan, tuple(undone), unknown_before(undone))
    if not (asked.force or asked.rolls_back or asked.is_part_of_group):
        refuse_unknown(undo_plan)
    return undo_plan


def refuse_unknown(back: UndoPlan) -> None:
    """Raise UsageError if *back* would do nothing because all former values are unknown."""
    if back.unknown and not back.plan.changes:
        raise UsageError(
            back.unknown[0].text,
            node=back.plan.node_id,
            hint=Hint(Action.UNDO, {"force": True}, "leaves it so and forgets that change"),
        )


def undo_plan_of(
    node: KnownPdos,
    plans: Iterable[Plan],
    *,
    with_substitutes: bool = False,
    rolls_back: bool = False,
    patient: bool = False,
) -> Plan:
    """The plan from present values of *node* to the values before the oldest of *plans* (oldest first).

    The caller has invalidated reads from before its lock. A write-only object stays unchanged (`unknown_before`). With
    *with_substitutes* a PDO with an expected refusal gets its substitute. Only with *rolls_back* (nothing stored since)
    our stamp returns (`stamp_back`). With *patient* objects unreadable at present are left out; else raises SdoAborted.
    """
    pdos: dict[Pdo, PdoConfig] = {}
    values: dict[tuple[int, int], Step] = {}
    for change in (change for plan in reversed(list(plans)) for change in reversed(plan.changes)):
        if isinstance(change, PdoChange):
            substitute = change.substitute if with_substitutes else None
            pdos[change.pdo] = change.before if substitute is None else substitute
        else:
            values[change.step.index, change.step.sub_index] = change.step
    changes = [plan_pdo(pdo, node.known_pdo(pdo), before) for pdo, before in pdos.items()]
    undo_changes = (*changes, *_value_changes(node, pdos, values, patient=patient))
    return Plan(node.node_id, undo_changes if rolls_back else _stamp_ended(node, undo_changes, values))


def _stamp_ended(
    node: KnownPdos, undo_changes: tuple[Change, ...], values: dict[tuple[int, int], Step]
) -> tuple[Change, ...]:
    """*undo_changes*, preceded by the removal of our stamp and without its return; *values* are the changed values."""
    others = tuple(change for change in undo_changes if not is_stamp(change))
    before = {
        at[1]: step.before for at, step in values.items() if at[0] == VERIFY_CONFIGURATION and step.before is not None
    }
    if not (others or before):
        return ()
    ended = stamp_back(node, others, before)
    return undo_changes if ended is None else (*ended, *others)


def _value_changes(
    node: ReadableNode, pdos: dict[Pdo, PdoConfig], values: dict[tuple[int, int], Step], *, patient: bool
) -> Iterator[Change]:
    back: list[Step] = []
    for (index, sub_index), step in values.items():
        before = step.before
        pdo = Pdo.at(index)
        if pdo is not None and _is_filler(pdos.get(pdo) or node.known_pdo(pdo)):
            continue
        if before is not None:
            try:
                held = node.known_value(index, sub_index)
            except SdoAborted:
                if not patient:
                    raise
                continue  # the roll-back finds out whether the object is writable
            back.append(replace(step, before=held, after=before, reason="old value"))
    return map(ValueChange, altering(back))


def _is_filler(config: PdoConfig) -> bool:
    """True if an entry behind the mapping count is a meaningless filler now, and not writable."""
    return config.enabled or config.count > 0


def refuse_unless_left(node: Changeable, plans: Sequence[Plan], count: int) -> int:
    """Return how many of the newest of *plans* (oldest first) an undo of *count* plans covers.

    This is *count* if *node* has the values that these plans left. If a reset brought back the values from before some
    of the newest plans, it is the number of these, if larger: they are undone already. Raises SafetyRefusal with the
    first difference if the node has other values, as after a change by another tool.
    """
    refuse_gap(node, plans[-count:])
    found = config_differences(node, _ends(plans[-count:]))
    if not found:
        return count
    for gone in range(1, len(plans) + 1):
        left = plans[len(plans) - count : len(plans) - gone]
        if not config_differences(node, beginnings(plans[-gone:])) and not config_differences(node, _ends(left)):
            return max(gone, count)
    raise SafetyRefusal(
        f"node {node.node_id} does not hold the values of that change: {found[0][0]} {found[0][1]}",
        node=node.node_id,
        why=join_some(f"{label} {text}" for label, text in found[1:]) or None,
        hint=Hint(Action.SHOW_PDOS, why=f"{verbatim(who_else(node.guard))}: check it with {{}}")
        + Hint(Action.UNDO, {"force": True}, "restores the values before that change nevertheless")
        + Hint(Action.UNDO, {"backup": True}, ", {} an automatic backup"),
    )


def _ends(plans: Sequence[Plan]) -> TargetConfig:
    """The final values of *plans*."""
    return _wish((change for plan in plans for change in plan.changes), before=False)


def beginnings(plans: Sequence[Plan]) -> TargetConfig:
    """The values before the first of *plans*."""
    return _wish((change for plan in reversed(plans) for change in reversed(plan.changes)), before=True)


def _wish(changes: Iterable[Change], *, before: bool) -> TargetConfig:
    """The last result per object in *changes*, or the first value if *before*.

    Without unreadable objects, without entries behind a mapping's count (meaningless), and without our stamps, which
    devices clear by themselves and which do not come back.
    """
    target, own = TargetConfig(), False
    for change in changes:
        if isinstance(change, PdoChange):
            target.pdos[change.pdo] = change.before if before else change.after
            continue
        step = change.step
        if step.before is not None and Pdo.at(step.index) is None:
            target.values[step.index, step.sub_index] = step.before if before else step.after
        own = own or ((step.index, step.sub_index) == (VERIFY_CONFIGURATION, DATE) and _is_own_date(step))
    if own:
        for sub_index in (DATE, TIME):
            target.values.pop((VERIFY_CONFIGURATION, sub_index), None)
    return target


def _is_own_date(step: Step) -> bool:
    return any(is_own_date(int.from_bytes(data or b"", "little")) for data in (step.before, step.after))


def unknown_before(plans: Iterable[Plan]) -> tuple[Finding, ...]:
    """A warning for each write-only object of *plans*: its former value is unknown and it stays unchanged."""
    steps = (change.step for plan in plans for change in plan.changes if isinstance(change, ValueChange))
    return tuple(
        warning(
            "write-only",
            f"0x{step.object}",
            f"0x{step.object} {why_unreadable(step.index)}: its old value is not known, so it stays",
        )
        for step in steps
        if step.before is None
    )


def unrestored_objects(unknown: Iterable[Finding]) -> tuple[str, ...]:
    """The objects in *unknown* (from `unknown_before`) as `2050:00`, each once."""
    return tuple(dict.fromkeys(finding.place.removeprefix("0x") for finding in unknown))

"""Order of a network's changes: no RPDO ever receives frames with another layout than its own."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from dvtcli.domain.pdo import PdoConfig
from dvtcli.domain.plan import STAMP, Change, Plan, ValueChange, disables, needs_rtr_first, plan_pdo


def phases(plans: Iterable[Plan]) -> tuple[tuple[Plan, ...], ...]:
    """Split *plans*, one per node, into five phases; each is complete on every node before the next phase begins.

    First every changing TPDO is disabled, then every RPDO; then everything is written; then RPDOs are enabled, and
    finally TPDOs. The writes are the same as in *plans*. Backwards, phase by phase, the order holds as well.

    A stamp is cleared before all other writes of its node, and the new stamp set last: a device may clear it meanwhile.
    """
    split = [(plan.node_id, [part for change in _ordered(plan) for part in _parts(change)]) for plan in plans]
    found = []
    for phase in range(5):
        parts = ((node_id, tuple(change for number, change in parts if number == phase)) for node_id, parts in split)
        found.append(tuple(Plan(node_id, changes) for node_id, changes in parts if changes))
    return tuple(found)


_FIRST, _WRITE, _LAST = 0, 2, 4


def _ordered(plan: Plan) -> Iterator[Change]:
    """The changes of *plan*: clear stamps first, set stamps last."""
    yield from (part for change in plan.changes for part in _stamps(change) if not any(part.step.after))
    yield from (change for change in plan.changes if not _is_stamp(change))
    yield from (part for change in plan.changes for part in _stamps(change) if any(part.step.after))


def _is_stamp(change: Change) -> bool:
    return isinstance(change, ValueChange) and change.step.index == STAMP


def _stamps(change: Change) -> tuple[ValueChange, ...]:
    return tuple(map(ValueChange, change.steps)) if _is_stamp(change) else ()


def _parts(change: Change) -> Iterator[tuple[int, Change]]:
    """The parts of *change* with writes, each with its phase number."""
    if isinstance(change, ValueChange):
        yield (_LAST if any(change.step.after) else _FIRST) if _is_stamp(change) else _WRITE, change
        return
    off, on = (0, 4) if change.pdo.is_tpdo else (1, 3)
    now, want = change.before, change.after
    held = _disabled(now) if disables(now, want) else now
    first = want.communication.cob_id.disabled() if needs_rtr_first(now, want) else held.communication.cob_id
    written = replace(want, communication=replace(want.communication, cob_id=first))
    for number, before, after in ((off, now, held), (_WRITE, held, written), (on, written, want)):
        part = plan_pdo(change.pdo, before, after)
        if part.steps:
            yield number, part


def _disabled(config: PdoConfig) -> PdoConfig:
    return replace(config, communication=replace(config.communication, cob_id=config.communication.cob_id.disabled()))

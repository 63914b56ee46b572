"""The configuration stamp in 0x1020 of a node, and its removal by a change."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeGuard

from dvtcli.device.read_pdos import UNREADABLE
from dvtcli.domain.objects import STORE_PARAMETERS, VERIFY_CONFIGURATION
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan, Step, ValueChange, alters
from dvtcli.domain.store import DATE, TIME, Stamp, is_own_date
from dvtcli.errors import SdoAborted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dvtcli.device.known_pdos import KnownPdos
    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.domain.plan import Change

#: What 0x1020 says of a configuration that nobody vouches for.
NO_STAMP = Stamp(0, 0)
_ENDS = "a configuration that changes loses its stamp"


def held_stamp(node: KnownPdos) -> Stamp | None:
    """The stamp in 0x1020 of *node*, read since the last change; None without a writable stamp.

    Raises SdoAborted if temporarily unreadable: the object may contain our stamp all the same.
    """
    days = _read(node, DATE)
    ms = None if days is None else _read(node, TIME)
    return None if days is None or ms is None else Stamp(days, ms)


def _read(node: KnownPdos, sub_index: int) -> int | None:
    if node.dictionary is not None:
        entry = node.dictionary.entry(VERIFY_CONFIGURATION, sub_index)
        if entry is None or not (entry.access.readable and entry.access.writable):
            return None
    elif node.has_no_stamp:
        return None
    try:
        data = node.read_cache.upload(VERIFY_CONFIGURATION, sub_index)
    except SdoAborted as aborted:
        if aborted.code not in UNREADABLE:
            raise
        node.has_no_stamp = True
        return None
    return int.from_bytes(data[:4], "little") if data and not any(data[4:]) else None  # otherwise the stamp is not ours


def stamp_changes(held: Stamp, wanted: Stamp, reason: str) -> tuple[ValueChange, ...]:
    """The changes from *held* to *wanted*: both sub-indices, even if equal, by way of 0."""
    steps = (
        Step(VERIFY_CONFIGURATION, sub_index, held.data(sub_index), wanted.data(sub_index), reason)
        for sub_index in (DATE, TIME)
    )
    return tuple(ValueChange(step) for step in steps if any(step.before or b"") or any(step.after))


def ended_stamp(node: KnownPdos, changes: Sequence[Change]) -> tuple[ValueChange, ...]:
    """The writes needed ahead of *changes* to remove our stamp from *node*, if the stamp covers the changes.

    A device should clear the stamp itself (CiA 301, 0x1020), but not every device does.
    """
    if any(is_stamp(change) for change in changes) or not any(_configures(node, change) for change in changes):
        return ()
    if not is_own_date(_read(node, DATE) or 0):
        return ()
    held = held_stamp(node)
    return stamp_changes(held, NO_STAMP, _ENDS) if held is not None and held.is_own else ()


def stamp_back(
    node: KnownPdos, others: Sequence[Change], before: Mapping[int, bytes]
) -> tuple[ValueChange, ...] | None:
    """The changes to a stamp if *others* restore former values; *before* is the former 0x1020 by sub-index.

    Our stamp asserts stored values, and a store since is possible: it is never restored, and a present stamp is
    removed. None if neither stamp is ours: 0x1020 is treated as any other object.
    """
    held = held_stamp(node)
    if held is None:
        return None
    was = {sub_index: before.get(sub_index, held.data(sub_index)) for sub_index in (DATE, TIME)}
    old = Stamp(*(int.from_bytes(was[sub_index], "little") for sub_index in (DATE, TIME)))
    if not (held.is_own or old.is_own):
        return None
    is_half = 0 in (held.days, held.ms)  # whoever wrote it was killed
    return (
        stamp_changes(held, NO_STAMP, _ENDS) if held != old and (held.is_own or is_half) else ended_stamp(node, others)
    )


def with_stamp_ended(node: KnownPdos, plan: Plan) -> Plan:
    """*plan*, preceded by the removal of our stamp if needed."""
    return Plan(plan.node_id, (*ended_stamp(node, plan.changes), *plan.changes))


def is_stamp(change: Change) -> TypeGuard[ValueChange]:
    """True if *change* writes 0x1020."""
    return isinstance(change, ValueChange) and change.step.index == VERIFY_CONFIGURATION


def _configures(node: NodeDescription, change: Change) -> bool:
    """True if *change* alters the configuration, including a restore, but not a command, target or store."""
    if not isinstance(change, ValueChange):
        return alters(change)
    step = change.step
    if Pdo.at(step.index) is not None:
        return True
    entry = None if node.dictionary is None else node.dictionary.entry(step.index, step.sub_index)
    saves = (step.index, step.sub_index) == node.profile.store.saved_by or step.index == STORE_PARAMETERS
    return alters(change) and not saves and not (entry is not None and entry.pdo_mapping)

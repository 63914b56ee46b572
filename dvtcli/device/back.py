"""The way back: from what a device holds now to what it held before a plan. Used by `undo` and `recover`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.pending import CHANGE
from dvtcli.device.transaction import restore_patiently
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, ValueChange, plan_pdo
from dvtcli.domain.rules.finding import Finding, warning
from dvtcli.domain.several import several
from dvtcli.errors import DvtcliError, LeftChanged, SafetyRefusal, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.journal import Identity, Journal
    from dvtcli.device.node import Node


def plan_back(node: Node, plans: Iterable[Plan]) -> Plan:
    """The plan from what *node* holds now to what it held before the oldest of *plans* (oldest first).

    The node is read anew, since nothing is known of what happened to it meanwhile. A write-only object stays as it
    is (`unknown_before`).
    """
    pdos: dict[Pdo, PdoConfig] = {}
    values: dict[tuple[int, int], Step] = {}
    for change in (change for plan in reversed(list(plans)) for change in reversed(plan.changes)):
        if isinstance(change, PdoChange):
            pdos[change.pdo] = change.before
        else:
            values[change.step.index, change.step.sub_index] = change.step
    changes = [plan_pdo(pdo, node.pdo(pdo), before) for pdo, before in pdos.items()]
    return Plan(node.node_id, (*changes, *_value_changes(node, pdos, values)))


def _value_changes(node: Node, pdos: dict[Pdo, PdoConfig], values: dict[tuple[int, int], Step]) -> Iterator[Change]:
    for (index, sub_index), step in values.items():
        before = step.before
        pdo = Pdo.at(index)
        if pdo is not None and _is_filler(pdos.get(pdo) or node.pdo(pdo)):
            continue
        held = None if before is None else node.upload(index, sub_index)
        if before is not None and held != before:
            yield ValueChange(replace(step, before=held, after=before, reason="put the old value back"))


def _is_filler(config: PdoConfig) -> bool:
    """Whether a mapping entry that changed no configuration means nothing now, nor could be written."""
    return config.enabled or config.count > 0


def unknown_before(plans: Iterable[Plan]) -> tuple[Finding, ...]:
    """A warning for each write-only object of *plans*: what it held is not known, so it stays as it is."""
    steps = (change.step for plan in plans for change in plan.changes if isinstance(change, ValueChange))
    return tuple(
        warning("write-only", f"0x{step.object}", f"0x{step.object} is write-only: what it held is not known, it stays")
        for step in steps
        if step.before is None
    )


def recover(node: Node, journal: Journal) -> Plan:
    """Finish an interrupted change: put back what it replaced, verify that, restore the NMT state, forget the journal.

    Only forwards, towards what was: a failure leaves the journal for the next try (LeftChanged). Returns the plan
    of what was to be written. SafetyRefusal where the journal was made on another device.
    """
    if journal.plan.node_id != node.node_id or journal.identity != node.identity():
        raise SafetyRefusal(
            f"the journal was made on another device than node {node.node_id}",
            node=node.node_id,
            place=str(journal.path),
            why=f"it names {_text(journal.identity)}; this one is {_text(node.identity())}",
        )
    if node.keeper is not None:
        node.keeper.lock.take()
    plan = plan_back(node, [journal.plan])
    _put_back(node, journal)
    if journal.nmt_state == NmtState.OPERATIONAL and node.access.state() is NmtState.PRE_OPERATIONAL:
        node.access.insist(NmtState.OPERATIONAL)
    if node.keeper is not None:
        node.keeper.forget(journal)
    node.pending.suspicions.pop(CHANGE, None)
    return plan


def _put_back(node: Node, journal: Journal) -> None:
    node.gate.enter()
    try:
        with node.cancellation.guard():
            restore_patiently(node.sdo, journal.plan.changes, node.bus, node.gate.renew)
    except (DvtcliError, KeyboardInterrupt) as fault:
        labels = several(change.label for change in journal.plan.changes)
        raise LeftChanged(
            f"{labels} of node {node.node_id} could not be put back",
            node=node.node_id,
            place=str(journal.path),
            why=str(fault) or "interrupted",
            hint=_next_step(node, fault, journal),
            state="left_changed",
        ) from fault
    finally:
        node.forget()


def _next_step(node: Node, fault: BaseException, journal: Journal) -> str:
    again = f"recover tries again, from {journal.path}"
    if isinstance(fault, SdoAborted):  # the same again would be refused again; what it stored the device can go back to
        return f"nmt reset-node {node.node_id} brings back what it has stored, then recover checks that; {again}"
    return again


def _text(identity: Identity) -> str:
    return " ".join(f"{name} 0x{value:X}" for name, value in identity.items() if value is not None) or "no identity"

"""The way back: from what a device holds now to what it held before a plan. Used by `undo` and `recover`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from dvtcli.device.carry_out import run
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, ValueChange, plan_pdo
from dvtcli.errors import SafetyRefusal, UsageError

if TYPE_CHECKING:
    from dvtcli.device.journal import Identity, Journal
    from dvtcli.device.node import Node


def plan_back(node: Node, plans: Iterable[Plan]) -> Plan:
    """The plan from what *node* holds now to what it held before the oldest of *plans* (oldest first).

    The node is read anew, since nothing is known of what happened to it meanwhile. UsageError where a write-only
    object was changed: what it held is not known.
    """
    pdos: dict[Pdo, PdoConfig] = {}
    values: dict[tuple[int, int], bytes | None] = {}
    for change in (change for plan in reversed(list(plans)) for change in reversed(plan.changes)):
        if isinstance(change, PdoChange):
            pdos[change.pdo] = change.before
        else:
            values[change.step.index, change.step.sub_index] = change.step.before
    return Plan(node.node_id, (*_pdo_changes(node, pdos), *_value_changes(node, values)))


def _pdo_changes(node: Node, pdos: dict[Pdo, PdoConfig]) -> Iterator[Change]:
    for pdo, before in pdos.items():
        yield plan_pdo(pdo, node.pdo(pdo), before)


def _value_changes(node: Node, values: dict[tuple[int, int], bytes | None]) -> Iterator[Change]:
    for (index, sub_index), before in values.items():
        if before is None:
            where = f"0x{index:04X}:{sub_index:02X}"
            raise UsageError(f"{where} is write-only: what it held before is not known", node=node.node_id)
        held = node.upload(index, sub_index)
        if held != before:
            yield ValueChange(Step(index, sub_index, held, before, "put the old value back"))


def recover(node: Node, journal: Journal) -> Plan:
    """Finish an interrupted change: put back what it replaced, verify that, restore the NMT state, forget the journal.

    Returns the plan that was run. SafetyRefusal where the journal was made on another device.
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
    if len(plan):
        node.gate.enter()
        run(node, plan)
    if journal.nmt_state == NmtState.OPERATIONAL and node.access.state() is NmtState.PRE_OPERATIONAL:
        node.access.request(NmtState.OPERATIONAL)
    if node.keeper is not None:
        journal.path.unlink(missing_ok=True)
    node.suspect = None
    return plan


def _text(identity: Identity) -> str:
    return " ".join(f"{name} 0x{value:X}" for name, value in identity.items() if value is not None) or "no identity"

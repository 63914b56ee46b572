"""Check that RPDOs have a producer, and are mapped for its frames. Pure; reads nothing."""

from __future__ import annotations

from collections.abc import Collection, Container, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange
from dvtcli.domain.rules.finding import WARNING, Finding, Producer, Rule, warning

if TYPE_CHECKING:
    from dvtcli.domain.network.network_plan import NodePlan

RULES = (
    Rule("consumer-length", WARNING, "an RPDO of a network maps another length than the TPDO that it receives",
         "CiA 301, emergency error codes 0x8210 and 0x8220"),
    Rule("consumer-left", WARNING, "an RPDO still receives a CAN-ID that its TPDO gives up, and no other TPDO sends it",
         "CiA 301, 7.3.5: producer and consumer of a PDO have one CAN-ID"),
    Rule("rpdo-producer", WARNING,
         "no known node transmits the frames of an RPDO, and the family then reports a fault", "the family"),
)  # fmt: skip
#: a CAN-ID, and whether it has 29 bits
Id = tuple[int, bool]


class Sent(NamedTuple):
    """The TPDO *pdo* in its final state, and whether *node_plan* *changes* it."""

    node_plan: NodePlan
    pdo: Pdo
    config: PdoConfig
    changes: bool


def sent_by_id(node_plans: Iterable[NodePlan]) -> dict[Id, list[Sent]]:
    """TPDOs in *node_plans* with an enabled final state, by CAN-ID."""
    found: dict[Id, list[Sent]] = {}
    for node_plan in node_plans:
        changed = _changed(node_plan)
        for pdo, config in _ends(node_plan).items():
            if pdo.is_tpdo and config.enabled:
                sent = Sent(node_plan, pdo, config, pdo in changed)
                found.setdefault(_id(config.communication.cob_id), []).append(sent)
    return found


def by_id(pdos: Iterable[Producer]) -> dict[Id, list[Producer]]:
    """Enabled *pdos* by CAN-ID."""
    found: dict[Id, list[Producer]] = {}
    for pdo in pdos:
        if pdo.cob_id.valid:
            found.setdefault(_id(pdo.cob_id), []).append(pdo)
    return found


def length_findings(consumer: NodePlan, sent: Mapping[Id, Iterable[Sent]]) -> Iterator[Finding]:
    """A warning for each RPDO of *consumer* whose length differs from another node's TPDO in *sent*.

    Covers PDOs in the plans, and pairs of which a side changes.
    """
    changed = _changed(consumer)
    for rpdo, takes in _ends(consumer).items():
        cob_id = takes.communication.cob_id
        for producer in sent.get(_id(cob_id), ()) if not rpdo.is_tpdo and cob_id.valid else ():
            changes = producer.changes or rpdo in changed
            if changes and producer.node_plan is not consumer and producer.config.bits != takes.bits:
                yield _finding(
                    rpdo,
                    rpdo.label,
                    takes,
                    f"{producer.pdo.label} of node {producer.node_plan.node_id}",
                    producer.config,
                )


def moved_tpdos(node_plan: NodePlan) -> dict[Pdo, CobId]:
    """TPDOs that *node_plan* disables or moves to another CAN-ID, with the old COB-ID."""
    changes = (change for change in node_plan.plan.changes if isinstance(change, PdoChange) and change.pdo.is_tpdo)
    held = {change.pdo: change.before.communication.cob_id for change in changes if change.before.enabled}
    return {
        pdo: cob_id for pdo, cob_id in held.items() if not _same_id(cob_id, _ends(node_plan)[pdo].communication.cob_id)
    }


def left_findings(
    node_plan: NodePlan, moved: Mapping[Pdo, CobId], sent: Container[Id], received: Mapping[Id, Iterable[Producer]]
) -> Iterator[Finding]:
    """A warning for each RPDO in *received* that keeps a CAN-ID given up in *moved*, unless it is in *sent*.

    *sent* and *received* are the state after all nodes' plans.
    """
    for pdo, gone in moved.items():
        for producer in received.get(_id(gone), ()) if _id(gone) not in sent else ():
            if producer.node_id != node_plan.node_id:
                consumer = f"{producer.node_id}:{producer.pdo}"
                text = f"{consumer} still receives {gone}, which {node_plan.node_id}:{pdo} no longer sends"
                yield warning("consumer-left", f"0x{pdo.communication_index:04X}:01", text)


def changed_length(change: PdoChange, node_id: int, pdo: Pdo, held: PdoConfig) -> Finding | None:
    """A warning if *change* makes the PDO's length differ from *held*, its counterpart *pdo* of node *node_id*.

    None if neither the mapping nor the CAN-ID changes.
    """
    after, before = change.after, change.before
    ids = after.communication.cob_id, held.communication.cob_id
    is_new = before.bits != after.bits or not _same_id(before.communication.cob_id, ids[0])
    is_whole = not after.inconsistency and not held.inconsistency and after.mpdo is None and held.mpdo is None
    if pdo.is_tpdo is change.pdo.is_tpdo or not _same_id(*ids) or not (is_new and is_whole) or after.bits == held.bits:
        return None
    if change.pdo.is_tpdo:
        return _finding(change.pdo, f"{pdo.label} of node {node_id}", held, change.label, after)
    return _finding(change.pdo, change.label, after, f"{pdo.label} of node {node_id}", held)


def _same_id(one: CobId, other: CobId) -> bool:
    return one.valid and other.valid and _id(one) == _id(other)


def _finding(at: Pdo, rpdo: str, takes: PdoConfig, tpdo: str, sends: PdoConfig) -> Finding:
    place = f"0x{at.mapping_index:04X}:00"
    what = "is ignored (0x8210)" if takes.bits > sends.bits else "is taken in part (0x8220)"
    text = f"{rpdo} maps {takes.bits} bits, {tpdo} sends {sends.bits}: the frame {what}"
    return warning("consumer-length", place, text, "map the producer's layout, dummy/BITS for what is not wanted")


def _ends(node_plan: NodePlan) -> Mapping[Pdo, PdoConfig]:
    """Final state of the PDOs in *node_plan*."""
    changes = {change.pdo: change.after for change in node_plan.plan.changes if isinstance(change, PdoChange)}
    return {**node_plan.wanted, **changes}


def _id(cob_id: CobId) -> Id:
    return cob_id.can_id, cob_id.extended


def _changed(node_plan: NodePlan) -> set[Pdo]:
    return {change.pdo for change in node_plan.plan.changes if isinstance(change, PdoChange)}


def sent_by(pdos: Iterable[PdoConfig]) -> Iterator[tuple[int, bool]]:
    """CAN-ID, and whether it has 29 bits, of every enabled TPDO in *pdos*."""
    return (_identifier(config.communication.cob_id) for config in pdos if config.enabled)


def producer_findings(
    changes: Iterable[PdoChange], sent: Collection[tuple[int, bool]], consequence: str
) -> Iterator[Finding]:
    """A warning for each RPDO that *changes* enable or move to a CAN-ID that is not *sent* by a known node.

    *consequence* is the device's reaction to missing frames.
    """
    for change in changes:
        before, after = change.before.communication.cob_id, change.after.communication.cob_id
        if change.pdo.is_tpdo or not after.valid or before == after or _identifier(after) in sent:
            continue
        text = f"{change.label} waits for {after}, which no node that was read transmits: {consequence}"
        hint = Hint(Action.DISABLE, {"pdo": change.pdo}, "map it into a TPDO of another node, or {}")
        yield warning("rpdo-producer", f"0x{change.pdo.communication_index:04X}:01", text, hint)


def _identifier(cob_id: CobId) -> tuple[int, bool]:
    return cob_id.can_id, cob_id.extended

"""Whether consumers of a network are mapped for what its producers send. Knows configurations, and reads nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.network.network_plan import NodePlan
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange
from dvtcli.domain.rules.finding import Finding, Producer, warning
from dvtcli.domain.rules.rule import WARNING, Rule

RULES = (
    Rule("consumer-length", WARNING, "an RPDO of a network maps another length than the TPDO that it hears",
         "CiA 301, emergency error codes 0x8210 and 0x8220"),
    Rule("consumer-left", WARNING, "an RPDO goes on hearing a CAN-ID that a TPDO gives up and no other sends",
         "CiA 301, 7.3.5: producer and consumer of a PDO have one CAN-ID"),
)  # fmt: skip


def length_findings(consumer: NodePlan, plans: Iterable[NodePlan]) -> Iterator[Finding]:
    """A warning for each RPDO of *consumer* that is mapped for another length than a TPDO of *plans* sends.

    Looked at are PDOs that the plans are about, and of them pairs of which one side changes.
    """
    for other in plans:
        sent = {pdo: config for pdo, config in _ends(other).items() if pdo.is_tpdo and other is not consumer}
        for rpdo, takes in _ends(consumer).items():
            for tpdo, sends in sent.items() if not rpdo.is_tpdo else ():
                changes = _changes(other, tpdo) or _changes(consumer, rpdo)
                if changes and _meet(sends, takes) and sends.bits != takes.bits:
                    yield _finding(rpdo, takes, other.node_id, tpdo, sends)


def moved_tpdos(plan: NodePlan) -> dict[Pdo, CobId]:
    """The TPDOs that *plan* switches off or gives another CAN-ID, each with the COB-ID that it gives up."""
    changes = (one for one in plan.plan.changes if isinstance(one, PdoChange) and one.pdo.is_tpdo)
    held = {one.pdo: one.before.communication.cob_id for one in changes if one.before.enabled}
    return {pdo: cob_id for pdo, cob_id in held.items() if not _same_id(cob_id, _ends(plan)[pdo].communication.cob_id)}


def left_findings(
    plan: NodePlan, moved: Mapping[Pdo, CobId], sent: Iterable[Producer], heard: Iterable[Producer]
) -> Iterator[Finding]:
    """A warning for each RPDO of *heard* that goes on hearing what a TPDO of *moved* gave up, and nothing of *sent* is.

    Both are what nodes send and hear once *plan*, and those of the other nodes, are carried out.
    """
    sending = [one.cob_id for one in sent]
    hearing = list(heard)
    for pdo, gone in moved.items():
        if any(_same_id(gone, one) for one in sending):
            continue
        for one in hearing:
            if one.node_id != plan.node_id and _same_id(gone, one.cob_id):
                text = f"{one.node_id}:{one.pdo} goes on hearing {gone}, which {plan.node_id}:{pdo} sends no more"
                yield warning("consumer-left", f"0x{pdo.communication_index:04X}:01", text)


def _same_id(one: CobId, other: CobId) -> bool:
    return one.valid and other.valid and (one.can_id, one.extended) == (other.can_id, other.extended)


def _finding(rpdo: Pdo, takes: PdoConfig, node_id: int, tpdo: Pdo, sends: PdoConfig) -> Finding:
    place = f"0x{rpdo.mapping_index:04X}:00"
    what = "is ignored (0x8210)" if takes.bits > sends.bits else "is taken in part (0x8220)"
    text = f"{rpdo.label} maps {takes.bits} bits, {tpdo.label} of node {node_id} sends {sends.bits}: the frame {what}"
    return warning("consumer-length", place, text, "map the producer's layout, dummy/BITS for what is not wanted")


def _ends(plan: NodePlan) -> Mapping[Pdo, PdoConfig]:
    """The PDOs that *plan* is about, as they will be."""
    changes = {change.pdo: change.after for change in plan.plan.changes if isinstance(change, PdoChange)}
    return {**plan.wanted, **changes}


def _meet(sends: PdoConfig, takes: PdoConfig) -> bool:
    return _same_id(sends.communication.cob_id, takes.communication.cob_id)


def _changes(plan: NodePlan, pdo: Pdo) -> bool:
    return any(isinstance(change, PdoChange) and change.pdo == pdo for change in plan.plan.changes)

"""Whether consumers of a network are mapped for what its producers send. Knows configurations, and reads nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from dvtcli.domain.network.network_plan import NodePlan
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange
from dvtcli.domain.rules.finding import Finding, warning
from dvtcli.domain.rules.rule import WARNING, Rule

RULES = (
    Rule("consumer-length", WARNING, "an RPDO of a network maps another length than the TPDO that it hears",
         "CiA 301, emergency error codes 0x8210 and 0x8220"),
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
    sent, taken = sends.communication.cob_id, takes.communication.cob_id
    return sent.valid and taken.valid and (sent.can_id, sent.extended) == (taken.can_id, taken.extended)


def _changes(plan: NodePlan, pdo: Pdo) -> bool:
    return any(isinstance(change, PdoChange) and change.pdo == pdo for change in plan.plan.changes)

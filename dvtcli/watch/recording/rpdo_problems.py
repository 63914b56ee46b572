"""RPDOs that no frame in a recording has (CiA 301, 7.2.2)."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.lint.lint_rule import WARNING, LintRule
from dvtcli.domain.pdo import Pdo
from dvtcli.watch.decoder import Address
from dvtcli.watch.recording.node_problems import NodeProblems
from dvtcli.watch.recording.problems import Moment, Moments, Problem
from dvtcli.watch.sdo_transfers import SdoStep

NOT_SENT = LintRule(
    "rpdo-not-sent", WARNING, "a node in OPERATIONAL waits for an RPDO, and nobody sends it", "CiA 301, 7.2.2"
)
RPDO_RULES = (NOT_SENT,)
#: how long a node is in OPERATIONAL before an RPDO is missed (s)
_MISSED_S = 2.0
#: a node's PDO: node-ID and PDO
NodePdo = tuple[int, Pdo]


@dataclass(slots=True)
class RpdoProblems:
    """Knows which RPDOs are meant to be sent: the *described* ones, and those that are written in the recording."""

    described: Mapping[NodePdo, Address]
    _written: dict[NodePdo, tuple[Address, Moment] | None] = field(default_factory=dict)

    def take(self, moment: Moment, node_id: int, step: SdoStep) -> None:
        """Look at a *step* of an SDO transfer of *node_id*: it may have written a COB-ID."""
        if step.step != "done" or not step.is_write or step.place is None or step.place[1] != 1:
            return
        pdo = Pdo.at(step.place[0])
        if pdo is None or pdo.is_tpdo or step.place[0] != pdo.communication_index or len(step.data) != 4:
            return
        cob_id = CobId.from_raw(int.from_bytes(step.data, "little"))
        is_on = cob_id.valid and bool(cob_id.can_id)
        self._written[node_id, pdo] = ((cob_id.can_id, cob_id.extended), moment) if is_on else None

    def problems(self, sent: Collection[Address], nodes: NodeProblems) -> Iterator[Problem]:
        """Return RPDOs whose CAN-ID is not among those that were *sent*, of *nodes* that were in OPERATIONAL."""
        first = Moment(1, float("-inf"))
        known: dict[NodePdo, tuple[Address, Moment] | None] = {
            **{key: (address, first) for key, address in self.described.items()},
            **self._written,
        }
        for (node_id, pdo), found in sorted(known.items()):
            operational = nodes.operational(node_id)
            if found is None or operational is None or found[0] in sent:
                continue
            (can_id, extended), since = found
            begin, end = max(operational[0], since, key=lambda moment: moment.time_s), operational[1]
            if end.time_s - begin.time_s >= _MISSED_S:
                named = f"0x{can_id:0{8 if extended else 3}X}"
                text = f"{pdo.label} of node {node_id} is {named}, which nobody sends"
                look = f"who is to send {named}, and whether its TPDO is enabled and the sender in OPERATIONAL"
                yield Problem(NOT_SENT, text, f"node {node_id} and the sender of {named}", look, Moments.at(begin),
                              node_id, f"{pdo.communication_index:04X}:01")  # fmt: skip

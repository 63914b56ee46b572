"""The PDOs that a plan leaves alone: what is known of them before it, and which of them the device altered with it.

A device may alter the COB-ID of one PDO because another's was written. Reads; the transaction and the way back write.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from dvtcli.device.change.put_back import altered_cob_ids
from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, Plan, writes_cob_id
from dvtcli.domain.several import several
from dvtcli.errors import DeviceRefused

if TYPE_CHECKING:
    from dvtcli.device.change.changeable import Changeable
    from dvtcli.device.observe import Found
    from dvtcli.domain.ports import SdoTransport


@dataclass(slots=True)
class OtherPdos:
    """The PDOs beside a plan: the *cob_ids* as they were before it, and *wholes*, those that were read whole."""

    cob_ids: Mapping[Pdo, CobId] = field(default_factory=dict)
    wholes: Mapping[Pdo, PdoConfig] = field(default_factory=dict)
    #: those that were altered, of which nothing but the COB-ID could be put back
    _in_part: list[Pdo] = field(default_factory=list)

    def altered(self, sdo: SdoTransport) -> dict[Pdo, str]:
        """Those whose COB-ID is no longer what it was, each with what differs, in words."""
        return {
            pdo: f"0x{pdo.communication_index:04X}:01 was 0x{self.cob_ids[pdo].raw:08X}, is 0x{held.raw:08X}"
            for pdo, held in altered_cob_ids(sdo, self.cob_ids).items()
        }

    def changes(self, sdo: SdoTransport, pdos: Iterable[Pdo]) -> tuple[PdoChange, ...]:
        """What puts *pdos* back to what they held before the plan.

        Of one that was not read whole that is the COB-ID, and the rest as it is now.
        """
        return tuple(PdoChange(pdo, before, before, ()) for pdo, before in self._before(sdo, pdos))

    def _before(self, sdo: SdoTransport, pdos: Iterable[Pdo]) -> Iterator[tuple[Pdo, PdoConfig]]:
        for pdo in pdos:
            held = self.wholes.get(pdo)
            if held is None:
                self._in_part.append(pdo)
                held = read_pdo(sdo, pdo)
            yield pdo, replace(held, communication=replace(held.communication, cob_id=self.cob_ids[pdo]))

    def put_back_in_part(self, plan: Plan) -> str | None:
        """The device's state after the way back from *plan*; None where all were put back whole."""
        if not self._in_part:
            return None
        own, altered = (several(one.label for one in some) for some in (plan.changes, self._in_part))
        return (
            f"rolled back: {own} is as it was, and {altered} has its COB-ID again, read back equal; what else it held "
            "was not read before: look at it with `pdo`"
        )


def altered_too(plan: Plan, altered: Mapping[Pdo, str]) -> DeviceRefused:
    """The device did what *plan* says, and more: it *altered* other PDOs, as the words say."""
    own, first = several(change.label for change in plan.changes), next(iter(altered))
    return DeviceRefused(
        f"node {plan.node_id} took {own}, but altered {several(pdo.label for pdo in altered)} with it",
        node=plan.node_id,
        place=f"{first.communication_index:04X}:01",
        why="; ".join(altered.values()),
        hint="these PDOs depend on each other in this device: its manual says how",
    )


def cob_ids_beside(node: Changeable, plan: Plan) -> dict[Pdo, CobId]:
    """The COB-IDs that *plan* leaves alone, to be compared right after it; none where it writes no COB-ID.

    Not of PDOs that are looked at whole once the change that it is a part of is made.
    """
    own = {*_own(plan), *plan.looked_at}
    if not writes_cob_id(plan) or own.issuperset(node.present()):
        return {}
    return {pdo: cob_id for pdo, cob_id in node.known_cob_ids().items() if pdo not in own}


def wholes_beside(node: Changeable, plan: Plan, found: Found) -> dict[Pdo, PdoConfig]:
    """The PDOs that *plan* leaves alone, to be compared before a store: those that were read whole since *found*."""
    if not is_of_pdo(plan) or node.bus.boot_ups(node.node_id) != found.boot_ups:
        return {}
    own = set(_own(plan))
    movable = {pdo: config for pdo, config in node.last_read.items() if config.has_cob_id and not config.untold}
    return {pdo: config for pdo, config in movable.items() if pdo not in own}


def is_of_pdo(plan: Plan) -> bool:
    """Whether *plan* writes an object of a PDO."""
    return any(Pdo.at(step.index) for step in plan.steps)


def _own(plan: Plan) -> Iterator[Pdo]:
    """The PDOs that *plan* is about."""
    return (change.pdo for change in plan.changes if isinstance(change, PdoChange))

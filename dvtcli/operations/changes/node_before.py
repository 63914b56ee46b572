"""What the session knew of one node before a network plan, whether it is as before, and putting it back."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dvtcli.device.change.put_back import PATIENCE_S, RETRY_S, first_difference
from dvtcli.device.change.way_back import TakeBack
from dvtcli.domain.plan import Change, PdoChange, Plan
from dvtcli.errors import DeviceRefused, NoAnswer, SdoAborted, SdoProtocolError

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.pdo import Pdo, PdoConfig

#: What a node answers that is restarting, or does not.
_PASSING = (NoAnswer, SdoProtocolError, SdoAborted, DeviceRefused)


@dataclass(frozen=True, slots=True)
class NodeBefore:
    """What the session knew of a node before: what it had set, and what was not stored."""

    wanted: dict[Pdo, PdoConfig]
    values: dict[tuple[int, int], bytes]
    unstored: dict[str, int]
    boot_ups: int

    @classmethod
    def of(cls, node: Node, boot_ups: int) -> NodeBefore:
        """What is known of *node* now, of which *boot_ups* were heard by then."""
        return cls(dict(node.wanted), dict(node.wanted_values), dict(node.pending.unstored), boot_ups)

    def restarted(self, boot_ups: int) -> bool:
        """Whether a boot-up was heard since then, where *boot_ups* were by the last look at the node."""
        return boot_ups != self.boot_ups

    def restore(self, node: Node, boot_ups: int) -> None:
        """Know that again, once *node* is as it was, when *boot_ups* were heard; what a restart took stays said."""
        node.wanted.clear()
        node.wanted.update(self.wanted)
        node.wanted_values.clear()
        node.wanted_values.update(self.values)
        if not self.restarted(boot_ups):
            node.pending.unstored.clear()
            node.pending.unstored.update(self.unstored)


def put_back(node: Node, plan: Plan) -> None:
    """Put back what *plan* replaced, whatever is there now; a node that is silent or refuses may be restarting."""
    deadline_s = node.bus.now_s() + PATIENCE_S
    while True:
        try:
            node.put_back(TakeBack([plan], force=True, own=True, rolls_back=True, is_part=True))
        except _PASSING:
            if node.bus.now_s() >= deadline_s:
                raise
            node.bus.sleep(RETRY_S)
            with suppress(*_PASSING):
                node.gate.renew()  # where that fails too, the next try finds out
        else:
            return


def difference_from_before(node: Node, plan: Plan) -> str | None:
    """The first thing of *plan* that *node* holds neither as before nor as what it takes instead."""

    def look() -> str | None:
        for change in plan.changes:
            found = first_difference(node.sdo, change, wanted_before=True)
            if found and not is_otherwise(node, change):
                return f"{change.label}: {found}"
        return None

    return node.observed(look)


def is_otherwise(node: Node, change: Change) -> bool:
    """Whether *node* holds what it takes instead of what it held."""
    if not isinstance(change, PdoChange) or change.back is None:
        return False
    if first_difference(node.sdo, change, wanted_before=True) is None:
        return False
    return first_difference(node.sdo, replace(change, after=change.back)) is None

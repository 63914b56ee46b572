"""Who produces SYNC: what the nodes' 0x1005 and 0x1006 say, and what is heard on the bus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.rules.finding import warning
from dvtcli.domain.rules.rule import WARNING, Rule
from dvtcli.operations.results import Facts

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.operations.session import Session

RULES = (Rule("sync-producer", WARNING, "`sync --check`: nobody produces SYNC", "CiA 301, 7.5.2.5 and 7.5.2.6"),)

#: Bit 30 of 0x1005: this node produces SYNC.
_PRODUCES = 1 << 30
#: The bus is listened to for two periods of the slowest node, within these limits, in seconds.
_SHORTEST_S, _LONGEST_S = 0.1, 2.5


@dataclass(frozen=True, slots=True)
class _Source:
    """What one node says of SYNC; None where it has no such object."""

    node_id: int
    cob_id: int | None
    period_us: int | None

    @property
    def produces(self) -> bool:
        return bool(self.cob_id is not None and self.cob_id & _PRODUCES and self.period_us)

    @property
    def can_id(self) -> int:
        return 0x080 if self.cob_id is None else self.cob_id & 0x1FFF_FFFF

    def text(self) -> str:
        """One line for the screen."""
        word = "no 0x1005" if self.cob_id is None else f"0x1005 = 0x{self.cob_id:08X}"
        period = "no 0x1006" if self.period_us is None else f"0x1006 = {self.period_us} us"
        if self.period_us:
            period += f" ({self.period_us / 1000:g} ms)"
        does = "produces SYNC" if self.produces else "does not produce SYNC"
        return f"node {self.node_id}  {does}: {word}, {period}; its SYNC is 0x{self.can_id:03X}"


def check_sync(session: Session) -> Facts:
    """Ask the nodes, listen to the bus, and warn where nobody produces SYNC; sends no SYNC itself."""
    sources = [_source(node) for node in _nodes(session)]
    periods = [source.period_us for source in sources if source.period_us]
    listen_s = min(_LONGEST_S, max(_SHORTEST_S, 2e-6 * max(periods, default=0)))
    can_ids = {0x080} | {source.can_id for source in sources}
    heard = sum(frame.can_id in can_ids for frame in session.wire.receive(listen_s))
    produced = heard > 0 or any(source.produces for source in sources)
    finding = warning(
        "sync-producer", "0x1005:00", "nobody produces SYNC: synchronous PDOs stay silent",
        "`write 1005 0x40000080` makes a node the producer, or `sync --period 20 --count 100` sends SYNC from here",
    )  # fmt: skip
    rows = (
        ("produced", produced),
        ("heard", heard),
        ("listened_ms", round(listen_s * 1000)),
        ("nodes", [{"node": s.node_id, "cob_id": s.cob_id, "period_us": s.period_us} for s in sources]),
    )
    text = (*(source.text() for source in sources), f"on the bus: {heard or 'no'} SYNC in {listen_s * 1000:.0f} ms")
    return Facts("sync-check", rows, text, findings=() if produced else (finding,))


def _nodes(session: Session) -> list[Node]:
    """The nodes that were looked at, the simulated ones, and the selected one."""
    network = session.network
    selected = session.selected_id()
    node_ids = {*network.nodes, *network.simulated_ids} | (set() if selected is None else {selected})
    return [session.node(node_id) for node_id in sorted(node_ids)]


def _source(node: Node) -> _Source:
    return _Source(node.node_id, read_optional(node.sdo, 0x1005, 0, 4), read_optional(node.sdo, 0x1006, 0, 4))

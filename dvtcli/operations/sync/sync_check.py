"""Who produces SYNC: what the nodes' 0x1005 and 0x1006 say, and what is heard on the bus."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.rules.finding import warning
from dvtcli.domain.rules.rule import WARNING, Rule
from dvtcli.operations.results import SyncCheck, SyncSource

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.operations.session.session import Session

RULES = (Rule("sync-producer", WARNING, "`sync --check`: nobody produces SYNC", "CiA 301, 7.5.2.5 and 7.5.2.6"),)

#: The bus is listened to for two periods of the slowest node, within these limits, in seconds.
_SHORTEST_S, _LONGEST_S = 0.1, 2.5


def check_sync(session: Session, node_ids: Iterable[int] = ()) -> SyncCheck:
    """Ask the nodes, listen to the bus, and warn where nobody produces SYNC; sends no SYNC itself.

    The nodes are those that were looked at, the simulated ones, the selected one, and *node_ids*.
    """
    sources = tuple(_source(node) for node in _nodes(session, node_ids))
    periods = [source.period_us for source in sources if source.period_us]
    listen_s = min(_LONGEST_S, max(_SHORTEST_S, 2e-6 * max(periods, default=0)))
    can_ids = {0x080} | {source.can_id for source in sources}
    heard = sum(frame.can_id in can_ids for frame in session.wire.receive(listen_s))
    checked = SyncCheck(sources, heard, round(listen_s * 1000))
    finding = warning(
        "sync-producer",
        "0x1005:00",
        "nobody produces SYNC: synchronous PDOs stay silent",
        Hint(Action.WRITE, {"object": "1005", "value": "0x40000080"}, "makes a node the producer")
        + Hint(Action.SEND_SYNC, {"period": 20, "count": 100}, ", or {} sends SYNC from here"),
    )
    return checked if checked.produced else replace(checked, findings=(finding,))


def _nodes(session: Session, besides: Iterable[int]) -> list[Node]:
    network = session.network
    selected = session.selected_id()
    node_ids = {*network.nodes, *network.simulated_ids, *besides} | (set() if selected is None else {selected})
    return [session.node(node_id) for node_id in sorted(node_ids)]


def _source(node: Node) -> SyncSource:
    return SyncSource(node.node_id, read_optional(node.sdo, 0x1005, 0, 4), read_optional(node.sdo, 0x1006, 0, 4))

"""PDOs that a network file sets, or links, and that the device does not have. Reads nodes, and writes nothing.

Does not know what the PDOs should hold.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.domain.abort import Abort
from dvtcli.domain.rules.finding import error
from dvtcli.domain.rules.rule import ERROR, Rule
from dvtcli.errors import DvtcliError, RuleError, SdoAborted, UsageError

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.file_complaint import FileComplaint
    from dvtcli.domain.network.wanted_state import Endpoint, Mark, NetworkWish, NodeWish
    from dvtcli.domain.pdo import Pdo
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.files.network.file_log import FileLog

RULES = (
    Rule("pdo-lacking", ERROR, "a network file sets a PDO, or links one, that the device does not have",
         "the device's own answer"),
)  # fmt: skip


def without_lacked(nodes: Mapping[int, Node], wish: NetworkWish, log: FileLog) -> tuple[NetworkWish, RuleError | None]:
    """*wish* without the PDOs that its *nodes* lack and the links of these, and the error that says which they are."""
    asked: dict[int, dict[Pdo, Mark]] = {}
    for one in wish.nodes:
        asked[one.node_id] = {pdo.pdo: pdo.mark for pdo in one.pdos}
    for link in wish.links:
        for end in link.ends:
            asked[end.node_id].setdefault(end.pdo, link.mark)
    for node in list(nodes.values())[:1]:
        ahead = [partial(_look_ahead, nodes[node_id], pdos) for node_id, pdos in asked.items()]
        for fault in node.bus.side_by_side(ahead):
            raise fault  # a Ctrl-C, or a bus that is gone
    lacked = _Lacked(log)
    for node_id, pdos in asked.items():
        for pdo, mark in pdos.items():
            lacked.look(nodes[node_id], pdo, mark)
    left = lacked.left_of(wish)
    return left, lacked.error(wish, left)


def _look_ahead(node: Node, pdos: Mapping[Pdo, Mark]) -> None:
    """Read *pdos*; what cannot be read is told where it is needed."""
    for pdo in pdos:
        with suppress(DvtcliError):
            node.known_pdo(pdo)


@dataclass(slots=True)
class _Lacked:
    """What is not there, and where the file that *log* is about asks for it."""

    log: FileLog
    pdos: list[tuple[int, Pdo]] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    complaints: list[FileComplaint] = field(default_factory=list)
    abort: int | None = None

    def look(self, node: Node, pdo: Pdo, mark: Mark) -> None:
        """Take *pdo* in where *node* says that it has none; raises as reading it does for any other reason."""
        try:
            node.known_pdo(pdo)
        except (SdoAborted, UsageError) as lacked:
            if isinstance(lacked, SdoAborted) and lacked.code not in (Abort.NO_OBJECT, Abort.NO_SUB_INDEX):
                raise
            self.pdos.append((node.node_id, pdo))
            self.abort = self.abort or lacked.abort
            place = f"0x{lacked.place}" if lacked.place else pdo.label
            self.findings.append(error("pdo-lacking", place, lacked.text, hint=lacked.hint))
            if mark.line:
                self.complaints.append(self.log.shown(mark, lacked.text))

    def left_of(self, wish: NetworkWish) -> NetworkWish:
        """*wish* without them, and without stamps: they would stand for what is left."""
        if not self.pdos:
            return wish
        links = tuple(
            replace(link, consumers=heard)
            for link in wish.links
            if not self._has(link.producer) and (heard := tuple(end for end in link.consumers if not self._has(end)))
        )
        return replace(wish, nodes=tuple(map(self._node, wish.nodes)), links=links)

    def _has(self, end: Endpoint) -> bool:
        return (end.node_id, end.pdo) in self.pdos

    def _node(self, wish: NodeWish) -> NodeWish:
        left = tuple(pdo for pdo in wish.pdos if (wish.node_id, pdo.pdo) not in self.pdos)
        return replace(wish, pdos=left, stamp=None)

    def _torn(self, wish: NetworkWish, left: NetworkWish) -> tuple[tuple[int, Pdo], ...]:
        """The other ends of links of *wish* that are not in *left*: what these want of them is not known."""
        linked = {link.producer for link in left.links}
        gone = [end for link in wish.links if link.producer not in linked for end in link.ends]
        return tuple(dict.fromkeys((end.node_id, end.pdo) for end in gone if not self._has(end)))

    def error(self, wish: NetworkWish, left: NetworkWish) -> RuleError | None:
        """The error for all of them, None for none; *left* is what is left of *wish*."""
        if not self.pdos:
            return None
        place = f"{self.complaints[0].place}: " if self.complaints else ""
        ids = {node_id for node_id, _ in self.pdos}
        only = ids.pop() if len(ids) == 1 else None
        found = RuleError(f"{place}{self.findings[0].text}", self.findings, node=only, can_force=False)
        found.complaints, found.abort, found.lacking = tuple(self.complaints), self.abort, tuple(self.pdos)
        found.torn = self._torn(wish, left)
        return found

"""Find PDOs and objects that a network file sets or links and the device lacks.

Reads nodes, and writes nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.read_cache import read_side_by_side
from dvtcli.domain.abort import Abort, abort_text
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.network_plan import Lacked
from dvtcli.domain.network.wanted_state import ValueWish
from dvtcli.domain.rules.finding import ERROR, Rule, error
from dvtcli.errors import DvtcliError, SdoAborted, UsageError
from dvtcli.operations.plans.resolve_names import set_elsewhere
from dvtcli.operations.values.named_objects import object_at

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.network.network_plan import NetworkPlan
    from dvtcli.domain.network.wanted_state import Endpoint, Mark, NetworkWish, NodeWish, ObjectWish
    from dvtcli.domain.pdo import Pdo
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.files.network.file_log import FileLog

Place = tuple[int, int]
RULES = (
    Rule("pdo-lacking", ERROR, "a network file sets a PDO, or links one, that the device does not have",
         "the device's own answer"),
    Rule("object-lacking", ERROR, "a network file sets an object that the device does not have",
         "the device's own answer"),
)  # fmt: skip
_LACKED = (Abort.NO_OBJECT, Abort.NO_SUB_INDEX)
#: what to do about a missing object
_HINT = Hint(
    Action.FIND_OBJECTS,
    why="is it the device that is meant? leave the object out of the file; {} finds what an EDS lists",
)


def refuse_lacking(plan: NetworkPlan) -> NetworkPlan:
    """Return *plan*; raises RuleError if devices lack objects of its file: nothing is carried out."""
    if plan.lacking:
        from dvtcli.operations.results.failures import lacking_error

        raise lacking_error(plan.lacking)
    return plan


def without_lacked(
    nodes: Mapping[int, ReadableNode], wish: NetworkWish, log: FileLog
) -> tuple[NetworkWish, LackedOfWish]:
    """Drop from *wish* what its *nodes* lack and the links of such PDOs; returns both."""
    asked: dict[int, dict[Pdo, Mark]] = {}
    for node_wish in wish.nodes:
        asked[node_wish.node_id] = {pdo.pdo: pdo.mark for pdo in node_wish.pdos}
    for link in wish.links:
        for end in link.ends:
            asked[end.node_id].setdefault(end.pdo, link.mark)
    places = {wanted_node.node_id: dict(_places(nodes[wanted_node.node_id], wanted_node)) for wanted_node in wish.nodes}
    ahead = [partial(_look_ahead, nodes[node_id], pdos, places[node_id]) for node_id, pdos in asked.items()]
    read_side_by_side(nodes.values(), ahead)
    lacked = LackedOfWish(log)
    for node_id, pdos in asked.items():
        for pdo, mark in pdos.items():
            lacked.look(nodes[node_id], pdo, mark)
        for place, mark in places[node_id].items():
            lacked.look_at(nodes[node_id], place, mark)
    left = lacked.left_of(nodes, wish)
    lacked.torn = lacked.torn_of(wish, left)
    return left, lacked


def _look_ahead(node: ReadableNode, pdos: Mapping[Pdo, Mark], places: Mapping[Place, Mark]) -> None:
    """Read *pdos* and *places* ahead; read errors are raised later, at their use."""
    for pdo in pdos:
        with suppress(DvtcliError):
            node.known_pdo(pdo)
    for place in places:
        with suppress(DvtcliError):
            node.known_value(*place)


def _places(node: NodeDescription, wish: NodeWish) -> Iterator[tuple[Place, Mark]]:
    """Yield the single objects that *wish* sets, with their places in the file; forbidden objects are left out."""
    wishes: tuple[ObjectWish | ValueWish, ...] = (*wish.objects, *wish.values)
    for object_wish in wishes:
        place, mark = (
            _place_of(node, object_wish),
            object_wish.object.mark if isinstance(object_wish, ValueWish) else object_wish.mark,
        )
        if place is not None and not set_elsewhere(node, place):
            yield place, mark


def _place_of(node: NodeDescription, one: ObjectWish | ValueWish) -> Place | None:
    """Resolve an object name; None if *node* does not know it."""
    if not isinstance(one, ValueWish):
        return one.index, one.sub_index
    try:
        return object_at(node, one.object.text)
    except UsageError:
        return None


@dataclass(slots=True)
class LackedOfWish:
    """The missing objects (*found*) and PDOs linked with them (*torn*); *log* has their places in the file."""

    log: FileLog
    found: list[Lacked] = field(default_factory=list)
    torn: tuple[tuple[int, Pdo], ...] = ()
    _places: set[tuple[int, Place]] = field(default_factory=set)

    def of(self, node_id: int) -> tuple[str, ...]:
        """List labels of what the node with *node_id* lacks."""
        return tuple(lacked.label for lacked in self.found if lacked.node_id == node_id)

    def look(self, node: ReadableNode, pdo: Pdo, mark: Mark) -> None:
        """Add *pdo* if *node* does not have it; raises other errors of reading it."""
        try:
            node.known_pdo(pdo)
        except (SdoAborted, UsageError) as lacked:
            if isinstance(lacked, SdoAborted) and lacked.code not in _LACKED:
                raise
            place = f"0x{lacked.place}" if lacked.place else pdo.label
            finding = error("pdo-lacking", place, lacked.text, hint=lacked.hint)
            self._take(node, pdo, finding, mark, lacked.abort)

    def look_at(self, node: ReadableNode, place: Place, mark: Mark) -> None:
        """Add the object at *place* if *node* does not have it; other errors are reported elsewhere."""
        try:
            node.known_value(*place)
        except SdoAborted as lacked:
            if lacked.code in _LACKED:
                text = f"node {node.node_id} has no 0x{lacked.place}: {abort_text(lacked.code)}"
                hint = lacked.hint if node.dictionary is None else _HINT
                self._places.add((node.node_id, place))
                finding = error("object-lacking", f"0x{lacked.place}", text, hint=hint)
                self._take(node, None, finding, mark, lacked.abort)

    def _take(self, node: NodeDescription, pdo: Pdo | None, finding: Finding, mark: Mark, abort: int | None) -> None:
        complaint = self.log.shown(mark, finding.text) if mark.line else None
        self.found.append(Lacked(node.node_id, pdo, finding.place.removeprefix("0x"), finding, complaint, abort))

    def left_of(self, nodes: Mapping[int, NodeDescription], wish: NetworkWish) -> NetworkWish:
        """Return *wish* without them, and without stamps, which would cover only the rest."""
        if not self.found:
            return wish
        links = tuple(
            replace(link, consumers=heard)
            for link in wish.links
            if not self._has(link.producer) and (heard := tuple(end for end in link.consumers if not self._has(end)))
        )
        return replace(wish, nodes=tuple(self._node(nodes[node.node_id], node) for node in wish.nodes), links=links)

    def _has(self, end: Endpoint) -> bool:
        return any((lacked.node_id, lacked.pdo) == (end.node_id, end.pdo) for lacked in self.found)

    def _node(self, node: NodeDescription, wish: NodeWish) -> NodeWish:
        def is_there(one: ObjectWish | ValueWish) -> bool:
            place = _place_of(node, one)
            return place is None or (node.node_id, place) not in self._places

        lacked = {missing_object.pdo for missing_object in self.found if missing_object.node_id == wish.node_id}
        return replace(
            wish, pdos=tuple(pdo for pdo in wish.pdos if pdo.pdo not in lacked), stamp=None,
            objects=tuple(filter(is_there, wish.objects)), values=tuple(filter(is_there, wish.values)),
        )  # fmt: skip

    def torn_of(self, wish: NetworkWish, left: NetworkWish) -> tuple[tuple[int, Pdo], ...]:
        """List the other ends of links of *wish* missing in *left*: their configuration is unknown."""
        linked = {link.producer for link in left.links}
        gone = [end for link in wish.links if link.producer not in linked for end in link.ends]
        return tuple(dict.fromkeys((end.node_id, end.pdo) for end in gone if not self._has(end)))

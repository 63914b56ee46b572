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
from dvtcli.domain.network.network_config import ValueConfig
from dvtcli.domain.network.network_plan import MissingObject
from dvtcli.domain.rules.finding import ERROR, Rule, error
from dvtcli.errors import DvtcliError, SdoAborted, UsageError
from dvtcli.operations.plans.resolve_names import set_elsewhere
from dvtcli.operations.values.named_objects import object_at

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.network.network_config import Endpoint, Mark, NetworkConfig, NodeConfig, ObjectConfig
    from dvtcli.domain.network.network_plan import NetworkPlan
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
    why="check that it is the right device, or remove the object from the file; {} finds the objects of an EDS",
)


def refuse_lacking(plan: NetworkPlan) -> NetworkPlan:
    """Return *plan*; raises RuleError if devices lack objects of its file: nothing is carried out."""
    if plan.lacking:
        from dvtcli.operations.results.failures import missing_error

        raise missing_error(plan.lacking)
    return plan


def without_missing(
    nodes: Mapping[int, ReadableNode], config: NetworkConfig, log: FileLog
) -> tuple[NetworkConfig, MissingObjects]:
    """Drop from *config* what its *nodes* lack and the links of such PDOs; returns both."""
    asked: dict[int, dict[Pdo, Mark]] = {}
    for node_config in config.nodes:
        asked[node_config.node_id] = {pdo.pdo: pdo.mark for pdo in node_config.pdos}
    for link in config.links:
        for end in link.ends:
            asked[end.node_id].setdefault(end.pdo, link.mark)
    places = {
        wanted_node.node_id: dict(_places(nodes[wanted_node.node_id], wanted_node)) for wanted_node in config.nodes
    }
    ahead = [partial(_look_ahead, nodes[node_id], pdos, places[node_id]) for node_id, pdos in asked.items()]
    read_side_by_side(nodes.values(), ahead)
    missing = MissingObjects(log)
    for node_id, pdos in asked.items():
        for pdo, mark in pdos.items():
            missing.look(nodes[node_id], pdo, mark)
        for place, mark in places[node_id].items():
            missing.look_at(nodes[node_id], place, mark)
    left = missing.left_of(nodes, config)
    missing.unlinked = missing.unlinked_of(config, left)
    return left, missing


def _look_ahead(node: ReadableNode, pdos: Mapping[Pdo, Mark], places: Mapping[Place, Mark]) -> None:
    """Read *pdos* and *places* ahead; read errors are raised later, at their use."""
    for pdo in pdos:
        with suppress(DvtcliError):
            node.known_pdo(pdo)
    for place in places:
        with suppress(DvtcliError):
            node.known_value(*place)


def _places(node: NodeDescription, config: NodeConfig) -> Iterator[tuple[Place, Mark]]:
    """Yield the single objects that *config* sets, with their places in the file; forbidden objects are left out."""
    configs: tuple[ObjectConfig | ValueConfig, ...] = (*config.objects, *config.values)
    for object_config in configs:
        place, mark = (
            _place_of(node, object_config),
            object_config.object.mark if isinstance(object_config, ValueConfig) else object_config.mark,
        )
        if place is not None and not set_elsewhere(node, place):
            yield place, mark


def _place_of(node: NodeDescription, one: ObjectConfig | ValueConfig) -> Place | None:
    """Resolve an object name; None if *node* does not know it."""
    if not isinstance(one, ValueConfig):
        return one.index, one.sub_index
    try:
        return object_at(node, one.object.text)
    except UsageError:
        return None


@dataclass(slots=True)
class MissingObjects:
    """The missing objects (*found*) and PDOs linked with them (*unlinked*); *log* has their places in the file."""

    log: FileLog
    found: list[MissingObject] = field(default_factory=list)
    unlinked: tuple[tuple[int, Pdo], ...] = ()
    _places: set[tuple[int, Place]] = field(default_factory=set)

    def of(self, node_id: int) -> tuple[str, ...]:
        """List labels of what the node with *node_id* lacks."""
        return tuple(missing.label for missing in self.found if missing.node_id == node_id)

    def look(self, node: ReadableNode, pdo: Pdo, mark: Mark) -> None:
        """Add *pdo* if *node* does not have it; raises other errors of reading it."""
        try:
            node.known_pdo(pdo)
        except (SdoAborted, UsageError) as missing:
            if isinstance(missing, SdoAborted) and missing.code not in _LACKED:
                raise
            place = f"0x{missing.place}" if missing.place else pdo.label
            finding = error("pdo-lacking", place, missing.text, hint=missing.hint)
            self._take(node, pdo, finding, mark, missing.abort)

    def look_at(self, node: ReadableNode, place: Place, mark: Mark) -> None:
        """Add the object at *place* if *node* does not have it; other errors are reported elsewhere."""
        try:
            node.known_value(*place)
        except SdoAborted as missing:
            if missing.code in _LACKED:
                text = f"node {node.node_id} has no 0x{missing.place}: {abort_text(missing.code)}"
                hint = missing.hint if node.dictionary is None else _HINT
                self._places.add((node.node_id, place))
                finding = error("object-lacking", f"0x{missing.place}", text, hint=hint)
                self._take(node, None, finding, mark, missing.abort)

    def _take(self, node: NodeDescription, pdo: Pdo | None, finding: Finding, mark: Mark, abort: int | None) -> None:
        complaint = self.log.shown(mark, finding.text) if mark.line else None
        self.found.append(MissingObject(node.node_id, pdo, finding.place.removeprefix("0x"), finding, complaint, abort))

    def left_of(self, nodes: Mapping[int, NodeDescription], config: NetworkConfig) -> NetworkConfig:
        """Return *config* without them, and without stamps, which would cover only the rest."""
        if not self.found:
            return config
        links = tuple(
            replace(link, consumers=received)
            for link in config.links
            if not self._has(link.producer) and (received := tuple(end for end in link.consumers if not self._has(end)))
        )
        return replace(config, nodes=tuple(self._node(nodes[node.node_id], node) for node in config.nodes), links=links)

    def _has(self, end: Endpoint) -> bool:
        return any((missing.node_id, missing.pdo) == (end.node_id, end.pdo) for missing in self.found)

    def _node(self, node: NodeDescription, config: NodeConfig) -> NodeConfig:
        def is_there(one: ObjectConfig | ValueConfig) -> bool:
            place = _place_of(node, one)
            return place is None or (node.node_id, place) not in self._places

        missing = {missing_object.pdo for missing_object in self.found if missing_object.node_id == config.node_id}
        return replace(
            config, pdos=tuple(pdo for pdo in config.pdos if pdo.pdo not in missing), stamp=None,
            objects=tuple(filter(is_there, config.objects)), values=tuple(filter(is_there, config.values)),
        )  # fmt: skip

    def unlinked_of(self, config: NetworkConfig, left: NetworkConfig) -> tuple[tuple[int, Pdo], ...]:
        """List the other ends of links of *config* missing in *left*: their configuration is unknown."""
        linked = {link.producer for link in left.links}
        gone = [end for link in config.links if link.producer not in linked for end in link.ends]
        return tuple(dict.fromkeys((end.node_id, end.pdo) for end in gone if not self._has(end)))

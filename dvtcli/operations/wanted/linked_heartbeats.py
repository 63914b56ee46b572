"""What the links of a network come to in heartbeats: who sends one (0x1017), and who waits for it how long (0x1016)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from dvtcli.device.heartbeat_slots import heartbeat_ms, heartbeat_slots, is_guarded
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.heartbeats import MISSED, slot_for, watch_time_ms, watched_ms
from dvtcli.domain.network.wanted_state import (
    HeartbeatWatch,
    LinkWish,
    Mark,
    NetworkWish,
    NodeWish,
    ObjectWish,
    ValueWish,
)
from dvtcli.domain.object_syntax import parse_object
from dvtcli.domain.rules.finding import Finding, error, note, warning

if TYPE_CHECKING:
    from dvtcli.device.node import Node

_HEARTBEAT = "heartbeat_producer"
_CONSUMER = 0x1016


@dataclass(slots=True)
class LinkedHeartbeats:
    """The heartbeats of links between *nodes*, beside those that *before* wishes; *say* takes findings on a node."""

    nodes: Mapping[int, Node]
    before: NetworkWish
    say: Callable[[int, Finding], None]
    _producers: dict[int, list[ObjectWish]] = field(default_factory=dict)
    _watches: dict[int, dict[int, HeartbeatWatch]] = field(default_factory=dict)
    _slots: dict[int, dict[int, int]] = field(default_factory=dict)

    def watch(self, link: LinkWish, asked_ms: int | None) -> None:
        """The consumers wait for the producer's heartbeat, which is set to *asked_ms* where that is given."""
        node_id = link.producer.node_id
        time_ms = self._period_ms(node_id, asked_ms, link.mark)
        if not time_ms:
            text = f"node {node_id} sends no heartbeat: nobody notices when it is gone"
            self.say(node_id, note("link-silent", f"node {node_id}", text))
            return
        for consumer in dict.fromkeys(end.node_id for end in link.consumers):
            self._watch_one(consumer, HeartbeatWatch(node_id, time_ms, link.mark))

    def _period_ms(self, node_id: int, asked_ms: int | None, mark: Mark) -> int:
        """How often the producer will send a heartbeat, in ms; 0 for never."""
        node = self.nodes[node_id]
        if asked_ms is None:
            said = [*self._producers.get(node_id, ()), *_node(self.before, node_id).objects]
            return _wished_ms(said, heartbeat_ms(node.memory) or 0)
        place = f"node {node_id}"
        if heartbeat_ms(node.memory) is None:
            text = f"node {node_id} has no 0x1017: it cannot send a heartbeat"
            self.say(
                node_id,
                error(
                    "link-no-heartbeat", place, text, hint=Hint(Action.GIVE, {"heartbeat": False}, "leaves it alone")
                ),
            )
        elif is_guarded(node.memory):
            text = f"node {node_id} is guarded (0x100C and 0x100D are not 0), which excludes a heartbeat"
            self.say(
                node_id,
                error("link-guarded", place, text, hint=Hint(Action.GIVE, {"heartbeat": False}, "leaves it alone")),
            )
        wish = ObjectWish(_HEARTBEAT, 0x1017, 0, asked_ms.to_bytes(2, "little"), mark)
        self._producers.setdefault(node_id, []).append(wish)
        return asked_ms

    def _watch_one(self, consumer: int, heartbeat: HeartbeatWatch) -> None:
        """Node *consumer* waits longer than *heartbeat*, which its producer sends."""
        producer, time_ms = heartbeat.producer, heartbeat.time_ms
        if any(watch.producer == producer for watch in _node(self.before, consumer).watches):
            return  # somebody said how long
        if consumer not in self._slots:
            held = heartbeat_slots(self.nodes[consumer].memory)
            said = _said_slots(_node(self.before, consumer).values)
            self._slots[consumer] = held | {sub: value for sub, value in said.items() if sub in held}
        slots = self._slots[consumer]
        if watched_ms(slots, producer) > time_ms:
            return
        multiplier = MISSED if self.before.multiplier is None else self.before.multiplier
        late_ms, sub_index = watch_time_ms(time_ms, multiplier), slot_for(slots, producer)
        if late_ms is None or sub_index is None:
            text = f"node {consumer} does not watch node {producer}: {_why_not(slots, sub_index, time_ms)}"
            self.say(consumer, warning("link-unwatched", f"node {consumer}", text))
            return
        slots[sub_index] = producer << 16 | late_ms
        self._watches.setdefault(consumer, {})[producer] = replace(heartbeat, time_ms=late_ms)

    def taken_by(self, node: NodeWish) -> NodeWish:
        """*node* with the heartbeat that it sends, and those that it waits for."""
        objects = (*node.objects, *self._producers.get(node.node_id, ()))
        watches = (*node.watches, *self._watches.get(node.node_id, {}).values())
        return replace(node, objects=objects, watches=watches)


def _why_not(slots: Mapping[int, int], sub_index: int | None, time_ms: int) -> str:
    if not slots:
        return "it has no 0x1016"
    return "0x1016 has no free entry" if sub_index is None else f"no time that 0x1016 takes is longer than {time_ms} ms"


def _node(wish: NetworkWish, node_id: int) -> NodeWish:
    return next(node for node in wish.nodes if node.node_id == node_id)


def _said_slots(values: Iterable[ValueWish]) -> dict[int, int]:
    """The entries of 0x1016 that *values* name by number, by sub-index: what is no number is told where it is meant."""
    found: dict[int, int] = {}
    for value in values:
        place = parse_object(value.object.text)
        if place is not None and place[0] == _CONSUMER:
            with suppress(ValueError):
                found[place[1]] = int(value.value.text, 0)
    return found


def _wished_ms(said: Iterable[ObjectWish], held_ms: int) -> int:
    """What is *said* of 0x1017, else what the node holds."""
    return next((int.from_bytes(wish.data, "little") for wish in said if wish.key == _HEARTBEAT), held_ms)

"""Virtual PDOs of a node: connections of its physical pins to application objects, with rules and changes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.device.change.applied import Applied, refuse
from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.plan import Plan, Step, ValueChange
from dvtcli.domain.profile import VpdoGroup
from dvtcli.domain.rules.finding import ERROR, Finding, Rule, error
from dvtcli.errors import DvtcliError, UsageError

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode

#: The highest sub-index that an object can have for an entry of its own (CiA 301, 7.4.8).
_MOST_PINS = 0xFE


def group_names(node: NodeDescription) -> list[str]:
    """The groups of virtual PDOs of the node's family. Raises DvtcliError if it has none."""
    if node.profile.vpdo:
        return list(node.profile.vpdo)
    raise DvtcliError(
        f"node {node.node_id} ({node.profile.title}) has no virtual PDOs",
        node=node.node_id,
        hint=Hint(Action.SHOW_NODE, {"node": node.node_id}, "tells its profile")
        + Hint(Action.GIVE_PROFILE, why="uses another profile if it is wrong"),
    )


def read_pins(node: ReadableNode, name: str) -> Pins:
    """The present pins of the group called *name*. Raises UsageError if the node has no such group."""
    if name not in group_names(node):
        have = ", ".join(node.profile.vpdo)
        raise UsageError(f"node {node.node_id} has no virtual PDOs called {name!r}; it has {have}", node=node.node_id)
    group = node.profile.vpdo[name]
    active = int.from_bytes(node.upload(group.index, 0), "little")
    values = tuple(_values(node, group))
    return Pins(name, group, min(active, len(values)), values)


def _values(node: ReadableNode, group: VpdoGroup) -> Iterable[int]:
    """The value of each pin; the number of sub-indices is the device's number of pins of the kind."""
    for pin in range(1, _MOST_PINS + 1):
        held = read_optional(node.sdo, group.index, pin, 2)
        if held is None:
            return
        yield held


def tie_findings(node: NodeDescription, index: int, sub_index: int, data: bytes) -> Iterator[Finding]:
    """Findings against *data* at *index*:*sub_index* if the object is a pin of virtual PDOs."""
    for name, group in node.profile.vpdo.items():
        if group.index == index and sub_index and len(data) == 2:
            yield from Pins(name, group, 0, ()).findings(sub_index, int.from_bytes(data, "little"), node.dictionary)


def names_objects(node: NodeDescription, index: int, sub_index: int) -> bool:
    """True if a value at *index*:*sub_index* is the index of another object, as for a pin."""
    return bool(sub_index) and any(group.index == index for group in node.profile.vpdo.values())


def apply(node: Node, changes: Iterable[ValueChange], findings: Iterable[Finding], *, force: bool) -> Applied:
    """Apply *changes* of virtual PDOs, all or none, unless *findings* forbid them without *force*."""
    found = tuple(findings)
    refuse(found, "virtual PDOs not changed", node.node_id, force=force)
    return node.apply(Plan(node.node_id, tuple(changes)), found, force=force)


RULES = (
    Rule("vpdo-range", ERROR, "a virtual PDO names an object outside its group's published range", "the family",
         (Abort.GENERAL,)),
    Rule("vpdo-object", ERROR, "a virtual PDO names an object that the device's file does not have", "the EDS",
         (Abort.GENERAL,)),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Pins:
    """The pins in a group *name*: *values* are the connected objects' indices by pin, the first *active* count.

    Source: Sevcon PDO Fundamentals rev 2, 2.2: sub 0 is the number of active mappings, sub k belongs to pin k.
    """

    name: str
    group: VpdoGroup
    active: int
    values: tuple[int, ...]

    def place(self, sub_index: int) -> str:
        """A sub-index of the group for people: `0x3300:01`."""
        return f"0x{self.group.index:04X}:{sub_index:02X}"

    def tied(self) -> tuple[int | None, ...]:
        """The object index of every active pin, None for an unconnected pin."""
        return tuple(None if value == self.group.none else value for value in self.values[: self.active])

    def findings(self, pin: int, value: int, dictionary: ObjectDictionary | None) -> Iterator[Finding]:
        """Findings against connecting *pin* to the object at index *value*."""
        if not self.group.allows(value):
            ranges = ", ".join(
                f"{low:04X}" if low == high else f"{low:04X}-{high:04X}" for low, high in self.group.values
            )
            text = f"{self.name} takes objects {ranges}, not {value:04X}"
            yield error("vpdo-range", self.place(pin), text, Abort.GENERAL, "or the word none")
        elif value != self.group.none and dictionary is not None and value not in dictionary:
            text = f"0x{value:04X} is not in {dictionary.source}: the device cannot link the pin to it"
            yield error(
                "vpdo-object",
                self.place(pin),
                text,
                Abort.GENERAL,
                Hint(Action.FIND_OBJECTS, why="searches the dictionary"),
            )

    def tie(self, pin: int, value: int, name: str = "") -> Iterator[ValueChange]:
        """Writes that connect *pin* (1…) to the object at index *value*, named *name*; the group's none disconnects it.

        Inactive pins in between are disconnected, so that no old value becomes active; unconnected pins at the end are
        not counted.
        """
        none = self.group.none
        wanted = list(self.values[: self.active]) + [none] * (pin - self.active)
        wanted[pin - 1] = value
        for number, after in enumerate(wanted, 1):
            if number >= min(pin, self.active + 1) and self.values[number - 1] != after:
                yield self._write(number, self.values[number - 1], after, self.reason(number, after, name))
        count = len(wanted)
        while count and wanted[count - 1] == none:
            count -= 1
        yield from self.count(count)

    def count(self, count: int) -> Iterator[ValueChange]:
        """The write that makes *count* pins active, none if unchanged."""
        if count != self.active:
            before, after = bytes([self.active]), bytes([count])
            yield ValueChange(Step(self.group.index, 0, before, after, self.reason(0, count)))

    def with_ties(self, ties: Mapping[int, int]) -> dict[int, int]:
        """Values of the group by sub-index with *ties*, object indices by pin (1…), and the active count (0) last.

        Inactive pins in between are disconnected; disconnected pins of *ties* at the end are not counted.
        """
        none = self.group.none
        count = max(self.active, *(pin for pin, index in ties.items() if index != none), 0)
        while ties.get(count) == none:
            count -= 1
        between = dict.fromkeys(range(self.active + 1, count + 1), none)
        return {**dict(sorted({**between, **ties}.items())), 0: count}

    def reason(self, sub_index: int, value: int, name: str = "") -> str:
        """Text of *value* at a sub-index, with the object's *name*: `digital-in pin 1: 2121 Forward switch`."""
        if not sub_index:
            return f"{self.name}: {value} active"
        reason = "not linked" if value == self.group.none else f"{value:04X} {name}".rstrip()
        return f"{self.name} pin {sub_index}: {reason}"

    def _write(self, pin: int, before: int, after: int, reason: str) -> ValueChange:
        return ValueChange(
            Step(
                self.group.index,
                pin,
                before.to_bytes(2, "little"),
                after.to_bytes(2, "little"),
                reason,
                names_object=True,
            )
        )

"""Virtual PDOs: connections of a node's physical pins to application objects, and their changes. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.plan import Step, ValueChange
from dvtcli.domain.profile import VpdoGroup
from dvtcli.domain.rules.finding import ERROR, Finding, Rule, error

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
                yield self._write(number, self.values[number - 1], after, self.said(number, after, name))
        count = len(wanted)
        while count and wanted[count - 1] == none:
            count -= 1
        yield from self.count(count)

    def count(self, count: int) -> Iterator[ValueChange]:
        """The write that makes *count* pins active, none if unchanged."""
        if count != self.active:
            before, after = bytes([self.active]), bytes([count])
            yield ValueChange(Step(self.group.index, 0, before, after, self.said(0, count)))

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

    def said(self, sub_index: int, value: int, name: str = "") -> str:
        """Text of *value* at a sub-index, with the object's *name*: `digital-in pin 1: 2121 Forward switch`."""
        if not sub_index:
            return f"{self.name}: {value} active"
        said = "not linked" if value == self.group.none else f"{value:04X} {name}".rstrip()
        return f"{self.name} pin {sub_index}: {said}"

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

"""Which nodes of a network have stored, and which have not. Does not know why."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WhoStored:
    """Node-IDs of those that *stored*, of those that did not, and of those of which it is *unknown*.

    *not_held*: nodes that acknowledged their store, and then did not hold what was planned.
    """

    stored: tuple[int, ...] = ()
    not_stored: tuple[int, ...] = ()
    unknown: tuple[int, ...] = ()
    not_held: tuple[int, ...] = ()

    def rows(self) -> list[tuple[str, str]]:
        """The labelled lines of it for a screen."""
        rows = (("stored", self.stored), ("not stored", self.not_stored), ("unknown", self.unknown))
        said = [(label, f"node {', '.join(map(str, numbers))}") for label, numbers in rows if numbers]
        if self.not_held:
            nodes = ", ".join(map(str, self.not_held))
            said.append(
                ("not held", f"node {nodes}: its store was acknowledged, and it does not hold what was planned")
            )
        return said

    def document(self) -> dict[str, list[int]]:
        """What stands in a JSON document."""
        found = {"stored": [*self.stored], "not_stored": [*self.not_stored], "unknown": [*self.unknown]}
        return found | ({"not_held": [*self.not_held]} if self.not_held else {})

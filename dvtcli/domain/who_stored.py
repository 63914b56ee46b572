"""Which nodes of a network have stored, and which have not. Does not know why."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WhoStored:
    """Node-IDs of those that *stored*, of those that did not, and of those of which it is *unknown*."""

    stored: tuple[int, ...] = ()
    not_stored: tuple[int, ...] = ()
    unknown: tuple[int, ...] = ()

    def rows(self) -> list[tuple[str, str]]:
        """The labelled lines of it for a screen."""
        rows = (("stored", self.stored), ("not stored", self.not_stored), ("unknown", self.unknown))
        return [(label, f"node {', '.join(map(str, numbers))}") for label, numbers in rows if numbers]

    def document(self) -> dict[str, list[int]]:
        """What stands in a JSON document."""
        return {"stored": [*self.stored], "not_stored": [*self.not_stored], "unknown": [*self.unknown]}

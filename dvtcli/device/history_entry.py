"""An entry of the change history, and its form in a file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from dvtcli.device.change.plan_document import Identity, change_document, read_number, read_plan
from dvtcli.domain.plan import Plan

SCHEMA = "dvtcli.past/1"
#: no bus sees as many changes
MOST_NUMBER = 10**18


@dataclass(frozen=True, slots=True)
class ChangeHistoryEntry:
    """A verified change: its *plan*, time (ISO 8601, UTC), bus and device.

    *selected* is the node-ID given to dvtcli, whichever node was changed; None for none. *stored* are the labels taken
    by a store, *maybe_stored* those possibly taken. *undoes* marks the roll-back of stored changes: no `undo` reverts
    it, and it records values not stored since. *number* counts the changes of the bus; 0 in earlier versions.
    """

    id: str
    when: str
    bus: str
    identity: Identity
    plan: Plan
    selected: int | None = None
    stored: frozenset[str] = frozenset()
    undoes: bool = False
    number: int = 0
    maybe_stored: frozenset[str] = frozenset()

    @property
    def order(self) -> tuple[int, str]:
        """A key that grows with each change on the bus, independent of the clock, which may have been set back."""
        return self.number, self.when

    @property
    def labels(self) -> frozenset[str]:
        """The changed PDOs and objects."""
        return frozenset(change.label for change in self.plan.changes)

    def is_of(self, bus: str, identity: Identity) -> bool:
        """True if the change was made on a device of this *identity* on *bus*."""
        return (self.bus, self.identity) == (bus, identity)

    def is_meant(self, selected: int | None) -> bool:
        """True if the change is of the node *selected*, or was made with that selection; always true for None."""
        return selected is None or selected in (self.plan.node_id, self.selected)


def document(one: ChangeHistoryEntry) -> dict[str, Any]:
    """*one* as JSON."""
    return {
        "id": one.id,
        "when": one.when,
        "bus": one.bus,
        "node": one.plan.node_id,
        "identity": one.identity,
        "selected": one.selected,
        "stored": sorted(one.stored),
        "maybe_stored": sorted(one.maybe_stored),
        "undoes": one.undoes,
        "number": one.number,
        "changes": [change_document(change) for change in one.plan.changes],
    }


def recorded_changes(document: Any) -> Iterator[ChangeHistoryEntry]:
    """The entries in a file's *document*, oldest first. Raises ValueError if the format is another."""
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise ValueError(f"it does not say {SCHEMA}")
    changes = document.get("changes")
    if not isinstance(changes, list):
        raise ValueError("it lists no changes")
    for change in changes:
        identity, plan = read_plan(change)
        selected = None if change.get("selected") is None else read_number(change, "selected", 127, least=1)
        stored, maybe_stored = change.get("stored", []), change.get("maybe_stored", [])
        if not isinstance(stored, list) or not isinstance(maybe_stored, list):
            raise ValueError("stored is no list")
        yield ChangeHistoryEntry(
            str(change.get("id")), str(change.get("when")), str(change.get("bus")), identity, plan, selected,
            frozenset(map(str, stored)), change.get("undoes") is True,
            read_number(change, "number", MOST_NUMBER) if "number" in change else 0, frozenset(map(str, maybe_stored)),
        )  # fmt: skip

"""The history of changes to a device and its entries, newest last, for `undo` in a later process.

One file per device and node-ID, found by identity (0x1018). Adding and dropping require the node's lock.
"""

from __future__ import annotations

import json
import os
import uuid
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple

from dvtcli.device.change.journal import MOST_BYTES
from dvtcli.device.change.lock import WAIT_S, lock_within
from dvtcli.device.change.plan_document import Identity, change_document, read_number, read_plan
from dvtcli.device.change.private_file import file_name, open_private, private_folder, set_aside, to_disk, write_private
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.plan import Change, Plan, alters
from dvtcli.errors import InputFileError, SafetyRefusal

SCHEMA = "dvtcli.past/1"
#: no bus sees as many changes
MOST_NUMBER = 10**18


class ChangeHistoryEntry(NamedTuple):
    """A verified change: its *plan*, time (ISO 8601, UTC), bus and device.

    *selected* is the node-ID given to dvtcli, whichever node was changed; None for none. *stored* are the labels taken
    by a store, *maybe_stored* those possibly taken. *undoes* marks the roll-back of stored changes: no `undo` reverts
    it, and it records values not stored since. *number* counts the changes of the bus; 0 in earlier versions.
    *group_id* is common to changes made together; empty for a change by itself, and in earlier versions.
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
    group_id: str = ""

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
        "group": one.group_id,
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
            raise ValueError("stored is not a list")
        yield ChangeHistoryEntry(
            id=str(change.get("id")),
            when=str(change.get("when")),
            bus=str(change.get("bus")),
            identity=identity,
            plan=plan,
            selected=selected,
            stored=frozenset(map(str, stored)),
            undoes=change.get("undoes") is True,
            number=read_number(change, "number", MOST_NUMBER) if "number" in change else 0,
            maybe_stored=frozenset(map(str, maybe_stored)),
            group_id=str(change.get("group", "")),
        )


#: How many changes of a device are remembered.
MOST_CHANGES = 50
#: Serial numbers (0x1018:4) that are nobody's own: not set, or erased memory.
_NO_SERIAL = (None, 0, 0xFFFF_FFFF)
#: the number of the last change on a bus, in decimal
_COUNT_BYTES = 19


def has_serial(identity: Identity) -> bool:
    """True if *identity* distinguishes a device from others of its type."""
    return identity.get("serial") not in _NO_SERIAL


@dataclass(slots=True, eq=False, repr=False)
class ChangeHistory:
    """The changes on *bus*, in files of *folder*; *report* shows failures to record a change."""

    folder: Path
    bus: str
    report: Callable[[str], None] = lambda _text: None
    #: the node-ID given to dvtcli at its start
    selected: int | None = None
    #: entries added by this process, oldest first; None for a change that could not be recorded
    _own: list[tuple[Path, str] | None] = field(default_factory=list)

    def path(self, node_id: int, identity: Identity) -> Path:
        """The file for the device of this *identity* at *node_id*, existing or not."""
        return self.folder / f"{file_name(self.bus)}-{_words(identity)}-node{node_id}.json"

    def add(self, plan: Plan, identity: Identity, name: str = "", group_id: str = "") -> None:
        """Record the verified *plan* with the id *name*, or a new id if empty; *group_id* as of the entry.

        A failure does not affect the change.
        """
        path = self.path(plan.node_id, identity)
        self._own.append(None)  # counted among the changes of this process, even if its file fails
        try:
            entry = self._entry(plan, identity, name)._replace(group_id=group_id)
            self._write(path, [*self._sound(path), entry][-MOST_CHANGES:])
        except (OSError, SafetyRefusal) as failed:
            self.report(f"the change is done, but cannot be saved for a later undo: {_why(failed)}")
        else:
            self._own[-1] = (path, entry.id)

    @property
    def remembers_last(self) -> bool:
        """True if a later process can undo the last change of this process."""
        return not self._own or self._own[-1] is not None

    def _sound(self, path: Path) -> list[ChangeHistoryEntry]:
        """The entries in *path*; a damaged file is renamed."""
        try:
            return self._read(path)
        except InputFileError as damaged:
            aside = set_aside(path, "damaged")
            self.report(f"{damaged.text}: it is kept as {aside}")
            return []

    def newest(self, node_id: int, identity: Identity) -> ChangeHistoryEntry | None:
        """The last recorded change of a device at *node_id*. Raises InputFileError if its file is damaged."""
        return next(reversed(self.entries(node_id, identity)), None)

    def entries(self, node_id: int, identity: Identity, selected: int | None = None) -> list[ChangeHistoryEntry]:
        """The last changes of a device at *node_id*, oldest first, as far back as all belong to *selected*.

        Raises InputFileError if the file is damaged.
        """
        found = [entry for entry in self.all_of(node_id, identity) if not entry.undoes]
        meant = takewhile(lambda entry: entry.is_meant(selected), reversed(found))
        return list(meant)[::-1]

    def all_of(self, node_id: int, identity: Identity) -> list[ChangeHistoryEntry]:
        """All changes of a device at *node_id*, including roll-backs of stored changes by `undo`."""
        return [entry for entry in self._read(self.path(node_id, identity)) if entry.is_of(self.bus, identity)]

    def tops(self, selected: int | None) -> list[ChangeHistoryEntry]:
        """The last change of each device on this bus that belongs to *selected*, newest first.

        Skips damaged files.
        """
        found = self._last_of(f"{file_name(self.bus)}-*.json")
        meant = (entry for entry in found if entry.bus == self.bus and entry.is_meant(selected))
        return sorted(meant, key=lambda entry: entry.order, reverse=True)

    def moved(self, node_id: int, identity: Identity) -> ChangeHistoryEntry | None:
        """The last change of the device with this serial number at another node-ID than *node_id*.

        The caller must check for a second device with the same serial number.
        """
        if not has_serial(identity):
            return None
        found = self._last_of(f"{file_name(self.bus)}-{_words(identity)}-node*.json")
        return max(
            (entry for entry in found if entry.is_of(self.bus, identity) and entry.plan.node_id != node_id),
            key=lambda entry: entry.order,
            default=None,
        )

    def newest_of_all(self) -> ChangeHistoryEntry | None:
        """The last change on this bus, of any device; skips damaged files."""
        return next(iter(self.tops(None)), None)

    def _last_of(self, pattern: str, *, undoing: bool = False) -> Iterator[ChangeHistoryEntry]:
        for path in sorted(self.folder.glob(pattern)):
            with suppress(InputFileError):
                yield from [entry for entry in self._read(path) if undoing or not entry.undoes][-1:]

    def drop_entries(self, entries: Sequence[ChangeHistoryEntry], undo_plan: Plan) -> None:
        """Drop *entries* of one device, undone by *undo_plan*; *undo_plan* is recorded if they were stored."""
        for path in {self.path(entry.plan.node_id, entry.identity) for entry in entries}:
            self._drop(path, [entry.id for entry in entries], undo_plan)

    def drop(self, node_id: int, identity: Identity, names: Collection[str], undo_plan: Plan | None = None) -> None:
        """Drop the changes with the ids *names* after a roll-back, as by `recover`.

        *undo_plan* restores values that a store took, or may have taken, and is recorded for the next store.
        """
        path = self.path(node_id, identity)
        if names and path.exists():
            self._drop(path, names)
        if undo_plan is not None:
            try:
                self._remember_undo(undo_plan, undo_plan.changes, identity)
            except (OSError, SafetyRefusal) as failed:
                self.report(f"it is rolled back, but cannot be marked as not stored: {_why(failed)}")

    def was_stored(self, node_id: int, identity: Identity, labels: Collection[str]) -> None:
        """Mark *labels* as stored, and with them all earlier changes to the same PDOs and objects."""
        path, taken = self.path(node_id, identity), frozenset(labels)
        if not taken or not path.exists():
            return
        entries = [entry._replace(stored=entry.stored | taken & entry.labels) for entry in self._sound(path)]
        try:
            self._write(path, [entry for entry in entries if not (entry.undoes and entry.stored >= entry.labels)])
        except (OSError, SafetyRefusal) as failed:
            self.report(f"it is stored, but cannot be marked as stored: {_why(failed)}")

    def may_be_stored(self, node_id: int, identity: Identity, names: Collection[str]) -> None:
        """Mark the changes with the ids *names* as possibly stored, after a store without an answer.

        OSError and SafetyRefusal are shown, not raised.
        """
        path = self.path(node_id, identity)
        if not names or not path.exists():
            return
        entries = [
            entry._replace(maybe_stored=entry.labels) if entry.id in names else entry for entry in self._sound(path)
        ]
        try:
            self._write(path, entries)
        except (OSError, SafetyRefusal) as failed:
            self.report(f"it cannot be marked as stored for a later undo: {_why(failed)}")

    def drop_own(self, count: int, undo_plan: Plan) -> None:
        """Drop the last *count* changes of this process, undone by *undo_plan*."""
        last, self._own = self._own[-count:], self._own[:-count]
        dropped = [change for change in last if change is not None]
        for path in {path for path, _ in dropped}:
            self._drop(path, [name for _, name in dropped], undo_plan)

    def _drop(self, path: Path, names: Collection[str], undo_plan: Plan | None = None) -> None:
        """Drop the changes with the ids *names*; *undo_plan* is recorded for changes that had been stored."""
        try:
            found = self._sound(path)
            self._write(path, [entry for entry in found if entry.id not in names])
            if undo_plan is not None:
                self._add_undoing(undo_plan, [entry for entry in found if entry.id in names])
        except (OSError, SafetyRefusal) as failed:
            self.report(f"it is rolled back, but the history for undo cannot be written: {_why(failed)}")

    def _add_undoing(self, undo_plan: Plan, undone: Sequence[ChangeHistoryEntry]) -> None:
        stored = {label for entry in undone for label in entry.stored | entry.maybe_stored}
        self._remember_undo(
            undo_plan, (change for change in undo_plan.changes if change.label in stored), undone[-1].identity
        )

    def _remember_undo(self, undo_plan: Plan, undone_changes: Iterable[Change], identity: Identity) -> None:
        changes = tuple(change for change in undone_changes if alters(change))
        if changes:
            entry = self._entry(replace(undo_plan, changes=changes), identity, undoes=True)
            path = self.path(undo_plan.node_id, entry.identity)
            self._write(path, [*self._sound(path), entry][-MOST_CHANGES:])

    def _entry(self, plan: Plan, identity: Identity, name: str = "", *, undoes: bool = False) -> ChangeHistoryEntry:
        """The history entry for *plan* with the id *name*, or a new id if empty."""
        now = datetime.now(UTC).isoformat()
        entry, number = name or uuid.uuid4().hex, self._next_number()
        return ChangeHistoryEntry(
            id=entry,
            when=now,
            bus=self.bus,
            identity=identity,
            plan=plan,
            selected=self.selected,
            undoes=undoes,
            number=number,
        )

    def _next_number(self) -> int:
        """The next change number on this bus. Raises OSError and SafetyRefusal if the number cannot be saved."""
        private_folder(self.folder.parent, is_shared=True)
        private_folder(self.folder, is_shared=True)
        path = self.folder / f"{file_name(self.bus)}.count"
        with os.fdopen(open_private(path, os.O_RDWR | os.O_CREAT), "rb+", buffering=0) as file:
            lock_within(file, WAIT_S)
            digits = file.read(_COUNT_BYTES + 1)
            is_complete = len(digits) == _COUNT_BYTES and digits[:-1].isdigit()
            last = int(digits) if is_complete else self._highest_number()
            file.seek(0)
            file.write(f"{last + 1:0{_COUNT_BYTES - 1}d}\n".encode())
            to_disk(file.fileno())
        return last + 1

    def _highest_number(self) -> int:
        return max((entry.number for entry in self._last_of(f"{file_name(self.bus)}-*.json", undoing=True)), default=0)

    def _write(self, path: Path, entries: list[ChangeHistoryEntry]) -> None:
        documents = [document(entry) for entry in entries]
        text = json.dumps({"schema": SCHEMA, "changes": documents})
        while len(text) > MOST_BYTES:  # what could not be read back is not written either
            documents = documents[(len(documents) + 1) // 2 :]
            text = json.dumps({"schema": SCHEMA, "changes": documents})
        write_private(path, text)

    def _read(self, path: Path) -> list[ChangeHistoryEntry]:
        try:
            with path.open("rb") as file:
                data = file.read(MOST_BYTES + 1)
        except FileNotFoundError:
            return []
        except OSError as failed:
            raise _damaged(path, failed) from failed
        try:
            return list(recorded_changes(json.loads(data) if len(data) <= MOST_BYTES else None))
        except (ValueError, RecursionError) as wrong:
            raise _damaged(path, wrong) from wrong


def _words(identity: Identity) -> str:
    """*identity* as part of a file name."""
    words = [identity.get(name) for name in ("vendor", "product", "revision", "serial")]
    return "-".join("none" if word is None else f"{word:08X}" for word in words)


def _damaged(path: Path, why: Exception) -> InputFileError:
    return InputFileError(
        f"{path} does not contain the changes",
        place=str(path),
        why=str(why),
        hint=Hint(Action.UNDO, {"backup": True}, "puts an automatic backup back")
        + "the next change keeps this file under another name",
    )


def _why(failed: OSError | SafetyRefusal) -> str:
    return failed.text if isinstance(failed, SafetyRefusal) else failed.strerror or str(failed)

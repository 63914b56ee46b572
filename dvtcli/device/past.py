"""The changes that were made to a device, newest last, so that a later process can put the last one back.

One file a device and node-ID, found by its identity (0x1018). Whoever adds or drops holds the node's lock. Does not
read or write devices, and does not decide what is put back.
"""

from __future__ import annotations

import json
import uuid
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from itertools import takewhile
from pathlib import Path
from typing import Any

from dvtcli.device.change.journal import MOST_BYTES
from dvtcli.device.change.plan_document import Identity, change_document, read_number, read_plan
from dvtcli.device.change.private_file import file_name, set_aside, write_private
from dvtcli.domain.plan import Plan
from dvtcli.errors import InputFileError, SafetyRefusal

SCHEMA = "dvtcli.past/1"
#: How many changes of a device are remembered.
MOST_CHANGES = 50
#: Serial numbers (0x1018:4) that are nobody's own: not set, or erased memory.
_NO_SERIAL = (None, 0, 0xFFFF_FFFF)


@dataclass(frozen=True, slots=True)
class Recorded:
    """A change that was verified: its *plan*, when it was made (ISO 8601, UTC), on which bus and which device.

    *selected* is the node-ID that dvtcli was started with, whichever node was changed; None for none. *stored* are the
    labels of what a store took of it.
    """

    id: str
    when: str
    bus: str
    identity: Identity
    plan: Plan
    selected: int | None = None
    stored: frozenset[str] = frozenset()

    def is_of(self, bus: str, identity: Identity) -> bool:
        """Whether it was made on a device of this *identity* on *bus*."""
        return (self.bus, self.identity) == (bus, identity)

    def is_meant(self, selected: int | None) -> bool:
        """Whether it is one of the node *selected*, or was made from there; every one is where that is None."""
        return selected is None or selected in (self.plan.node_id, self.selected)


def has_serial(identity: Identity) -> bool:
    """Whether *identity* tells one device from the next of its kind."""
    return identity.get("serial") not in _NO_SERIAL


@dataclass(slots=True)
class Past:
    """The changes made on *bus*, in the files of *folder*; *say* shows what goes wrong with remembering."""

    folder: Path
    bus: str
    say: Callable[[str], None] = lambda _text: None
    #: the node-ID that dvtcli was started with
    selected: int | None = None
    #: what this process added, oldest first; None for a change that could not be remembered
    _own: list[tuple[Path, str] | None] = field(default_factory=list)

    def path(self, node_id: int, identity: Identity) -> Path:
        """The file of the device of this *identity* at *node_id*, whether there is one or not."""
        return self.folder / f"{file_name(self.bus)}-{_words(identity)}-node{node_id}.json"

    def add(self, plan: Plan, identity: Identity, name: str = "") -> None:
        """Remember *plan*, which was carried out and verified; its id is *name*, or a new one where that is empty.

        That this fails makes the change no less done.
        """
        path, now = self.path(plan.node_id, identity), datetime.now(UTC)
        entry = Recorded(name or uuid.uuid4().hex, now.isoformat(), self.bus, identity, plan, self.selected)
        self._own.append(None)  # its place among the changes of this process, whatever becomes of its file
        try:
            self._write(path, [*self._sound(path), entry][-MOST_CHANGES:])
        except (OSError, SafetyRefusal) as failed:
            self.say(f"the change is done, but cannot be remembered for a later `undo`: {_why(failed)}")
        else:
            self._own[-1] = (path, entry.id)

    def _sound(self, path: Path) -> list[Recorded]:
        """What *path* holds; a damaged file is set aside under another name."""
        try:
            return self._read(path)
        except InputFileError as damaged:
            aside = set_aside(path, "damaged")
            self.say(f"{damaged.text}: it is kept as {aside}")
            return []

    def newest(self, node_id: int, identity: Identity) -> Recorded | None:
        """The last change of a device at *node_id* that is remembered; InputFileError where its file is damaged."""
        return next(reversed(self.entries(node_id, identity)), None)

    def entries(self, node_id: int, identity: Identity, selected: int | None = None) -> list[Recorded]:
        """The last changes of a device at *node_id*, oldest first, as far back as all are meant by *selected*.

        InputFileError where its file is damaged.
        """
        found = [one for one in self._read(self.path(node_id, identity)) if one.is_of(self.bus, identity)]
        meant = takewhile(lambda one: one.is_meant(selected), reversed(found))
        return list(meant)[::-1]

    def tops(self, selected: int | None) -> list[Recorded]:
        """The last change of each device of this bus, where *selected* means it; newest first.

        Files that are damaged are passed over.
        """
        found = self._last_of(f"{file_name(self.bus)}-*.json")
        meant = (one for one in found if one.bus == self.bus and one.is_meant(selected))
        return sorted(meant, key=lambda one: one.when, reverse=True)

    def moved(self, node_id: int, identity: Identity) -> Recorded | None:
        """The last change of this device, by its serial number, while it had another node-ID than *node_id*.

        Whether it really is the same device, and not a second one with that serial number, others have to find out.
        """
        if not has_serial(identity):
            return None
        found = self._last_of(f"{file_name(self.bus)}-{_words(identity)}-node*.json")
        return max(
            (one for one in found if one.is_of(self.bus, identity) and one.plan.node_id != node_id),
            key=lambda one: one.when,
            default=None,
        )

    def newest_of_all(self) -> Recorded | None:
        """The last change on this bus, whichever device it was made on; files that are damaged are passed over."""
        return next(iter(self.tops(None)), None)

    def _last_of(self, pattern: str) -> Iterator[Recorded]:
        for path in sorted(self.folder.glob(pattern)):
            with suppress(InputFileError):
                yield from self._read(path)[-1:]

    def forget(self, entries: Sequence[Recorded]) -> None:
        """Drop *entries*, which are of one device and were put back."""
        for path in {self.path(one.plan.node_id, one.identity) for one in entries}:
            self._drop(path, [one.id for one in entries])

    def drop(self, node_id: int, identity: Identity, names: Collection[str]) -> None:
        """Drop the changes of those ids: they were put back, as `recover` does."""
        path = self.path(node_id, identity)
        if names and path.exists():
            self._drop(path, names)

    def was_stored(self, node_id: int, identity: Identity, labels: Collection[str]) -> None:
        """A store took what the device held of *labels*, and with that all that was changed of them before."""
        path, taken = self.path(node_id, identity), frozenset(labels)
        if not taken or not path.exists():
            return
        try:
            self._write(path, [replace(one, stored=one.stored | taken & _labels(one)) for one in self._sound(path)])
        except (OSError, SafetyRefusal) as failed:
            self.say(f"it is stored, but that cannot be remembered for a later `store`: {_why(failed)}")

    def forget_own(self, count: int) -> None:
        """Drop the last *count* changes that this process made: they were put back."""
        last, self._own = self._own[-count:], self._own[:-count]
        dropped = [one for one in last if one is not None]
        for path in {path for path, _ in dropped}:
            self._drop(path, [name for _, name in dropped])

    def _drop(self, path: Path, names: Collection[str]) -> None:
        try:
            self._write(path, [one for one in self._sound(path) if one.id not in names])
        except (OSError, SafetyRefusal) as failed:
            self.say(f"it is put back, but what `undo` remembers cannot be written: {_why(failed)}")

    def _write(self, path: Path, entries: list[Recorded]) -> None:
        documents = [_document(one) for one in entries]
        text = json.dumps({"schema": SCHEMA, "changes": documents})
        while len(text) > MOST_BYTES:  # what could not be read back is not written either
            documents = documents[(len(documents) + 1) // 2 :]
            text = json.dumps({"schema": SCHEMA, "changes": documents})
        write_private(path, text)

    def _read(self, path: Path) -> list[Recorded]:
        try:
            with path.open("rb") as file:
                data = file.read(MOST_BYTES + 1)
        except FileNotFoundError:
            return []
        except OSError as failed:
            raise _damaged(path, failed) from failed
        try:
            return list(_entries(json.loads(data) if len(data) <= MOST_BYTES else None))
        except (ValueError, RecursionError) as wrong:
            raise _damaged(path, wrong) from wrong


def _words(identity: Identity) -> str:
    """*identity* as part of a file's name."""
    words = [identity.get(name) for name in ("vendor", "product", "revision", "serial")]
    return "-".join("none" if word is None else f"{word:08X}" for word in words)


def _labels(one: Recorded) -> frozenset[str]:
    return frozenset(change.label for change in one.plan.changes)


def _document(one: Recorded) -> dict[str, Any]:
    return {
        "id": one.id,
        "when": one.when,
        "bus": one.bus,
        "node": one.plan.node_id,
        "identity": one.identity,
        "selected": one.selected,
        "stored": sorted(one.stored),
        "changes": [change_document(change) for change in one.plan.changes],
    }


def _entries(document: Any) -> Iterator[Recorded]:
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise ValueError(f"it does not say {SCHEMA}")
    changes = document.get("changes")
    if not isinstance(changes, list):
        raise ValueError("it lists no changes")
    for one in changes:
        identity, plan = read_plan(one)
        selected = None if one.get("selected") is None else read_number(one, "selected", 127, least=1)
        stored = one.get("stored", [])
        if not isinstance(stored, list):
            raise ValueError("stored is no list")
        yield Recorded(
            str(one.get("id")), str(one.get("when")), str(one.get("bus")), identity, plan, selected,
            frozenset(map(str, stored)),
        )  # fmt: skip


def _damaged(path: Path, why: Exception) -> InputFileError:
    return InputFileError(
        f"{path} does not tell what was changed",
        place=str(path),
        why=str(why),
        hint="`undo --backup` puts an automatic backup back; the next change keeps this file under another name",
    )


def _why(failed: OSError | SafetyRefusal) -> str:
    return failed.text if isinstance(failed, SafetyRefusal) else failed.strerror or str(failed)

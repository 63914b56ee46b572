"""The journal on disk during a change, to finish a killed change later.

A journal is written and synced before the first write, with space for its later versions, and removed after the change
is verified or rolled back. Its file has two slots: new content replaces the older one, so that a kill or a full disk
leaves one complete. Each slot is a line of fixed length: a checksum, a number that grows, and the content. The newest
valid line counts.
"""

from __future__ import annotations

import errno
import json
import os
import re
import zlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from dvtcli.device.change.change_group import GroupMember, Storing
from dvtcli.device.change.plan_document import (
    MOST_CHANGES,
    Identity,
    change_document,
    read_change,
    read_number,
    read_plan,
    read_plan_identity,
)
from dvtcli.device.change.private_file import (
    file_name,
    open_private,
    remove,
    stranger,
    sync_folder,
    to_disk,
    write_private,
)
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.plan import Plan
from dvtcli.errors import InputFileError, SafetyRefusal

SCHEMA = "dvtcli.journal/1"
#: A journal is no larger than what `MOST_CHANGES` fill; anything larger is something else.
MOST_BYTES = 5_000_000
#: A slot begins with a checksum (CRC-32) and its number, and a space behind each.
_HEAD = re.compile(rb"([0-9a-f]{8}) ([0-9]{10}) ")
HEAD_BYTES = 20
#: The errors of a full disk.
_FULL = (errno.ENOSPC, errno.EDQUOT)
_MOST_FILE_BYTES = 2 * (MOST_BYTES + HEAD_BYTES + 1)
#: What a journal's new name says of it: closed with what the device held, or set aside unused.
ACCEPTED, DISCARDED = "accepted", "discarded"


@dataclass(frozen=True, slots=True)
class Journal:
    """An interrupted change: its node, plan, initial NMT state (None: unknown), and its *member* of a change group."""

    path: Path
    bus: str
    identity: Identity
    plan: Plan
    nmt_state: int | None = None
    member: GroupMember = field(default_factory=GroupMember)

    @property
    def labels(self) -> list[str]:
        """The changes possibly written, for display."""
        return list(self.member.asked) or [change.label for change in self.plan.changes]


class JournalFolder(NamedTuple):
    """The journals of one *folder* for the bus called *bus*."""

    folder: Path
    bus: str

    def path(self, node_id: int) -> Path:
        """The path for the journal of *node_id*, existing or not."""
        return self.folder / f"{file_name(self.bus)}-{node_id}.json"

    def find(self, node_id: int) -> Journal | None:
        """The journal of *node_id*, or None. Raises InputFileError if damaged."""
        path = self.path(node_id)
        return read_journal(path) if path.exists() else None

    def _marker(self, group_id: str) -> Path:
        return self.folder / f"{group_id}.whole"

    def open_group(self, group_id: str) -> None:
        """Mark the group *group_id* as open, before its first journal: its journals count until `close_group`."""
        if not self._marker(group_id).exists():
            write_private(self._marker(group_id), "")

    def close_group(self, group_id: str) -> None:
        """Invalidate all remaining journals of the complete or rolled-back group at once."""
        if self._marker(group_id).exists():
            remove(self._marker(group_id))
            sync_folder(self.folder)

    def tidy(self, group_id: str | None) -> None:
        """Remove the group's marker after its last journal is gone.

        An unusable journal may belong to the group and counts.
        """
        if group_id is not None and self._marker(group_id).exists() and not self._may_have(group_id):
            self.close_group(group_id)

    def _may_have(self, group_id: str) -> bool:
        """True if the group with id *group_id* has a journal, or an unusable journal may belong to the group."""
        for path in self._paths():
            try:
                found = read_journal(path)
            except (InputFileError, SafetyRefusal):
                return True
            if (found.bus, found.member.group_id) == (self.bus, group_id):
                return True
        return False

    def _paths(self) -> Iterator[Path]:
        return self.folder.glob(f"{file_name(self.bus)}-*.json")

    def is_named(self, path: Path, node_id: int) -> bool:
        """True if *path* has the file name of a journal of *node_id*; other files are left alone."""
        return path.name == self.path(node_id).name

    def counts(self, path: Path) -> bool:
        """True for a journal at *path*, damaged or not, unless its group is complete."""
        if not path.exists():
            return False
        try:
            group_id = read_journal(path).member.group_id
        except (InputFileError, SafetyRefusal):
            return True
        return group_id is None or JournalFolder(path.parent, self.bus)._marker(group_id).exists()  # noqa: SLF001 - one of ours

    def all_of(self, group_id: str) -> list[Journal]:
        """The usable journals of the group with id *group_id*, by node-ID."""
        return sorted(self._of(group_id), key=lambda journal: journal.plan.node_id)

    def _of(self, group_id: str) -> Iterator[Journal]:
        for path in self._paths():
            with suppress(InputFileError, SafetyRefusal):
                found = read_journal(path)
                if (found.bus, found.member.group_id) == (self.bus, group_id):
                    yield found

    def write(
        self, plan: Plan, identity: Identity, nmt_state: int | None, member: GroupMember | None = None, *, room: int = 0
    ) -> Path:
        """Write and sync the journal of *plan* before its first write; readable by its owner only.

        *member* is its membership in a group, *room* is how many bytes to reserve for later versions. Raises OSError if
        the journal cannot be written, or is too large to read again; an existing journal of the same name stays
        unchanged then.
        """
        path = self.path(plan.node_id)
        text = self._text(plan, identity, nmt_state, member or GroupMember())
        if len(text) > MOST_BYTES or len(plan.changes) > MOST_CHANGES:
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG), str(path))
        if not replace_content(path, text, room):
            create_two_slot_file(path, text, min(len(text) + room, MOST_BYTES))
        return path

    @staticmethod
    def length_of(final: str, stores: Iterable[Storing]) -> int:
        """The bytes for *final* and *stores* in a journal."""
        return len(json.dumps([final, *map(_store_document, stores)]))

    def _text(self, plan: Plan, identity: Identity, nmt_state: int | None, member: GroupMember) -> str:
        document = {
            "schema": SCHEMA,
            "bus": self.bus,
            "node": plan.node_id,
            "identity": identity,
            "nmt_state": nmt_state,
            "whole": member.group_id,  # the name of a group in the file format
            "name": member.name,
            "entries": list(member.entries),
            "final": member.final,
            "asked": list(member.asked),
            "stores": [_store_document(store) for store in member.stores],
            "equal": [_store_document(store) for store in member.equal],
            "tests": [change_document(change) for change in member.tests],
            "changes": [change_document(change) for change in plan.changes],
        }
        return json.dumps(document)  # on one line: indentation takes ten times as long

    def remove(self, node_id: int) -> None:
        """Remove the journal of *node_id* after its change is verified, or rolled back and verified."""
        path = self.path(node_id)
        remove(path)
        sync_folder(path.parent)


def read_journal(path: Path) -> Journal:
    """Read a journal. Raises InputFileError with file and cause if damaged or not a journal.

    Raises SafetyRefusal if another user could have written the file.
    """
    try:
        with path.open("rb") as file:
            _refuse_strangers(path, os.fstat(file.fileno()))
            data = content_of(file.read(_MOST_FILE_BYTES + 1))
        document = json.loads(data) if len(data) <= MOST_BYTES else None
        return _journal(path, document)
    except (ValueError, RecursionError, OSError) as wrong:
        raise InputFileError(
            f"{path} is not a usable journal",
            place=str(path),
            why=str(wrong),
            hint=Hint(Action.RECOVER, {"discard": True}, "sets the file aside (it is kept under another name)")
            + Hint(Action.SHOW_PDOS, why="then check the node with {}, and correct its values")
            + Hint(Action.UNDO, {"backup": True}, ", or {} puts an automatic backup back"),
        ) from wrong


def unneeded_markers(folder: Path) -> list[Path]:
    """Markers of open groups without a journal in *folder*, left if a process was killed before the first journal.

    Empty if a journal is unusable: its marker may be needed.
    """
    try:
        needed = {read_journal(path).member.group_id for path in folder.glob("*.json")}
    except (InputFileError, SafetyRefusal):
        return []
    return sorted(path for path in folder.glob("*.whole") if path.stem not in needed)


def _refuse_strangers(path: Path, status: os.stat_result) -> None:
    """Raise SafetyRefusal if another user may have written the journal, which is written to a device."""
    found = stranger(str(path), status)
    if found is not None:
        raise SafetyRefusal(f"{path} is not used: {found[0]}", place=str(path), hint=found[1])


def _journal(path: Path, document: Any) -> Journal:
    """The journal in a JSON document. Raises ValueError naming the wrong part."""
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise ValueError(f"it does not say {SCHEMA}")
    identity, plan = read_plan(document)
    state = document.get("nmt_state")
    return Journal(
        path=path,
        bus=str(document.get("bus", "")),
        identity=identity,
        plan=plan,
        nmt_state=None if state is None else read_number(document, "nmt_state", 0xFF),
        member=_member(document),
    )


def _member(document: dict[str, Any]) -> GroupMember:
    """The change group of the journal; none in journals of earlier versions."""
    group_id, name, final = document.get("whole"), document.get("name", ""), document.get("final", "")
    entries, asked = document.get("entries", []), document.get("asked", [])
    if isinstance(group_id, str) and not re.fullmatch("[0-9a-f]{1,64}", group_id):  # part of a file name
        raise ValueError("the id of what it belongs to is malformed")
    lists = isinstance(entries, list) and isinstance(asked, list)
    if not lists or not all(isinstance(text, str) for text in (group_id or "", name, final, *entries, *asked)):
        raise ValueError("what it belongs to is malformed")
    tests = document.get("tests", [])
    if not isinstance(tests, list) or len(tests) > MOST_CHANGES:
        raise ValueError("what tests its stores is malformed")
    stores = tuple(_stores(document.get("stores", [])))
    equal = tuple(_stores(document.get("equal", [])))
    return GroupMember(
        group_id=group_id,
        name=name,
        entries=tuple(entries),
        final=final,
        asked=tuple(asked),
        stores=stores,
        tests=tuple(map(read_change, tests)),
        equal=equal,
    )


def _stores(document: Any) -> Iterator[Storing]:
    if not isinstance(document, list) or not all(isinstance(entry, dict) for entry in document):
        raise ValueError("its stores are malformed")
    for entry in document:
        holds = entry.get("holds", [])
        if not isinstance(holds, list) or len(holds) > MOST_CHANGES:
            raise ValueError("its stores are malformed")
        yield Storing(
            node_id=read_number(entry, "node", 127),
            group=str(entry.get("group")),
            is_done=entry.get("done") is True,
            identity=None if entry.get("identity") is None else read_plan_identity(entry),
            holds=tuple(map(read_change, holds)),
            is_begun=entry.get("begun") is True,
            is_refused=entry.get("refused") is True,
            is_accepted=entry.get("accepted") is True,
        )


def _store_document(one: Storing) -> dict[str, Any]:
    return {
        "node": one.node_id,
        "group": one.group,
        "done": one.is_done,
        "begun": one.is_begun,
        "refused": one.is_refused,
        "accepted": one.is_accepted,
        "identity": one.identity,
        "holds": [change_document(change) for change in one.holds],
    }


def create_two_slot_file(path: Path, content: str, size: int) -> None:
    """Write a new file of *content* (ASCII) with space for *size* bytes, synced to disk on return.

    Raises OSError and SafetyRefusal like `write_private`; an existing file of the same name stays unchanged then.
    """
    size = max(size, len(content))
    write_private(path, _line(content, 1, size) + " " * (size + HEAD_BYTES) + "\n", newline="\n")


def replace_content(path: Path, content: str, room: int = 0) -> bool:
    """Replace the content (ASCII) of the file at *path* without using more space; false if too little is reserved.

    *room* is how many further bytes to reserve. Raises OSError if the disk refuses all the same, as a copy-on-write
    file system may; the content stays unchanged then.
    """
    try:
        descriptor = open_private(path, os.O_RDWR)
    except FileNotFoundError:
        return False
    with os.fdopen(descriptor, "rb+", buffering=0) as file:
        lines = file.read().splitlines(keepends=True)
        is_ours = len(lines) == 2 and len(lines[0]) == len(lines[1])
        size = len(lines[0]) - HEAD_BYTES - 1 if is_ours else -1
        if len(content) + room > size:
            return False
        numbers = [_number(line) for line in lines]
        file.seek(numbers.index(min(numbers)) * len(lines[0]))
        try:
            left = memoryview(_line(content, max(numbers) + 1, size).encode())
            while left:
                left = left[file.write(left) :]
            to_disk(file.fileno())
        except OSError as failed:
            if failed.errno not in _FULL:
                raise
            why = f"{failed.strerror} for what has its space: this file system copies on write"
            raise OSError(failed.errno, why, str(path)) from failed
    return True


def content_of(data: bytes) -> bytes:
    """The content of a file with the bytes *data*; *data* unchanged if not in this format.

    Raises ValueError if no line is valid.
    """
    if not _HEAD.match(data):
        return data
    newest = max(data.split(b"\n")[:2], key=_number)
    if not _number(newest):
        raise ValueError("it was not written to its end")
    return newest[HEAD_BYTES:]


def _line(content: str, number: int, size: int) -> str:
    numbered = f"{number:010d} {content:{size}}"
    return f"{zlib.crc32(numbered.encode()):08x} {numbered}\n"


def _number(line: bytes) -> int:
    """The number of a valid *line*, else 0."""
    head, line = _HEAD.match(line), line.rstrip(b"\n")
    return int(head[2]) if head and int(head[1], 16) == zlib.crc32(line[9:]) else 0

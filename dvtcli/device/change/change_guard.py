"""The protection of a change on a real bus: lock, backup, our journal, and journals of interrupted changes."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from dvtcli.device.change.change_group import ChangeGroup, GroupMember
from dvtcli.device.change.change_history import ChangeHistory
from dvtcli.device.change.journal import Journal, JournalFolder, read_journal
from dvtcli.device.change.lock import NodeLock
from dvtcli.device.change.own_journal import ROOM_OF_TEST, OwnJournal, journal_files, journal_room
from dvtcli.device.change.plan_document import Identity
from dvtcli.device.change.private_file import (
    check_folder,
    file_name,
    remove,
    remove_unfinished,
    set_aside,
    write_private,
)
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, Plan, plan_pdo
from dvtcli.domain.script_line import REMARKS, backup_lines, backup_of, identity_line, serial_line
from dvtcli.errors import InputFileError, SafetyRefusal


@dataclass(slots=True, eq=False, repr=False)
class BackingUp:
    """The backups in *folder* of the node at *node_id* on *bus*; *history* is the change history of `undo`."""

    folder: Path
    bus: str
    node_id: int
    history: ChangeHistory

    def needed(self, identity: Identity, held: Mapping[Pdo, PdoConfig]) -> bool:
        """True if this device has no backup, or a PDO in *held* matches no backup and no remembered change.

        Raises SafetyRefusal if other users can write to the folder.
        """
        made = self._made(identity)
        unlike = [(pdo, config) for pdo, config in held.items() if not _is_in(made, pdo, config)]
        return not made or (bool(unlike) and not self._remembered(identity) >= set(unlike))

    def unlike_backups(self, identity: Identity, held: Mapping[Pdo, PdoConfig]) -> list[Pdo]:
        """The PDOs in *held* that match neither a backup of this device nor a remembered change.

        Raises SafetyRefusal if other users can write to the folder.
        """
        made, remembered = self._made(identity), self._remembered(identity)
        return [
            pdo for pdo, config in held.items() if (pdo, config) not in remembered and not _is_in(made, pdo, config)
        ]

    def _made(self, identity: Identity) -> list[set[str]]:
        """The backups of this device, each as a set of lines."""
        check_folder(self.folder)
        made = [set(backup.lines()) for backup in backups(self.folder, self.bus, self.node_id, identity)]
        return [lines for lines in made if serial_line(identity) in lines]

    def _remembered(self, identity: Identity) -> set[tuple[Pdo, PdoConfig]]:
        """The PDO configurations before and after the changes in the history; empty if the file is damaged."""
        try:
            entries = self.history.entries(self.node_id, identity)
        except InputFileError:  # the next change sets it aside and reports that
            return set()
        changes = (change for entry in entries for change in entry.plan.changes if isinstance(change, PdoChange))
        return {(change.pdo, config) for change in changes for config in (change.before, change.after)}

    def make(self, identity: Identity, pdos: Mapping[Pdo, PdoConfig], fixed: Collection[Pdo]) -> Path:
        """Write a backup of *pdos*, all PDOs of the device, and return the path; COB-IDs of *fixed* are read-only."""
        stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
        path = self.folder / f"{file_name(self.bus)}-{self.node_id}-{stamp}.dvt"
        write_private(path, "\n".join(backup_lines(identity, pdos, fixed)) + "\n")
        return path


def _is_in(made: Collection[set[str]], pdo: Pdo, config: PdoConfig) -> bool:
    """True if a backup in *made* (sets of lines) would set *pdo* to *config*."""
    return any(lines.issuperset(backup_of(pdo, config)) for lines in made)


@dataclass(slots=True, eq=False, repr=False)
class ChangeGuard:
    """The files of one node on the bus called *bus*: journals and backups below *folder*, locks in *locks*.

    All dvtcli processes of a user share the folder of the locks. *report* shows a message.
    """

    folder: Path
    locks: Path
    bus: str
    node_id: int
    report: Callable[[str], None] = lambda _text: None
    #: whether a PDO's COB-ID is known to be read-only
    is_fixed: Callable[[Pdo], bool] = lambda _pdo: False
    #: shows an important message, even with JSON output
    warn: Callable[[str], None] = lambda _text: None
    #: the command of this process, for other dvtcli waiting for the lock
    command: Callable[[], str] = lambda: ""
    #: the current change group
    group: ChangeGroup = field(default_factory=ChangeGroup)
    lock: NodeLock = field(init=False)
    journals: JournalFolder = field(init=False)
    #: the journal of this process
    own_journal: OwnJournal = field(init=False)
    #: the change history, for later processes
    history: ChangeHistory = field(init=False)
    _backing_up: BackingUp = field(init=False)

    def __post_init__(self) -> None:
        self.lock = NodeLock(self.locks, self.bus, self.node_id, self.command, self._remove_unfinished)
        self.journals = JournalFolder(self.folder / "journals", self.bus)
        self.own_journal = OwnJournal(self.journals, self.lock, self.group, self.warn)
        self.history = ChangeHistory(self.locks.parent / "changes", self.bus, self.warn)
        self._backing_up = BackingUp(self.folder / "backups", self.bus, self.node_id, self.history)

    def _remove_unfinished(self) -> None:
        """Remove half-written files left by a killed process; requires the lock, whose holder is the only writer."""
        own = self.journals.path(self.node_id)
        remove_unfinished(own.parent, own.name)
        remove_unfinished(self.folder / "backups", f"{own.stem}-*.dvt")
        remove_unfinished(self.history.folder, f"{file_name(self.bus)}-*-node{self.node_id}.json")

    def unfinished_journal(self) -> Path | None:
        """Path of the journal of an unfinished change, in our folder or as noted by another dvtcli."""
        with self._files("read"):
            own, noted = self.journals.path(self.node_id), self.lock.noted()
            if noted is not None and not self.journals.is_named(noted, self.node_id):
                noted = None
            return next((path for path in (own, noted) if path is not None and self.journals.counts(path)), None)

    def interrupted_journal(self) -> Journal | None:
        """The journal of a change without a running process, or None. Raises InputFileError if damaged."""
        with self._files("read"):
            path = self.unfinished_journal()
            if path is None or not self.lock.is_free():
                return None
            try:
                return read_journal(path)
            except InputFileError:
                if path.exists():
                    raise
                return None  # a process at work a moment ago has ended its change

    def lock_and_find_journal(self) -> Path | None:
        """As `unfinished_journal`, but under the lock: a change in progress is not an interrupted change.

        Raises SafetyRefusal if another dvtcli is working on the node. Keeps the lock only if there is a journal.
        """
        taken = not self.lock.held
        self.take_lock()
        with self._files("read"):
            path = self.unfinished_journal()
        if taken and path is None:
            self.lock.release()
        return path

    def take_lock(self) -> None:
        """Take the lock, even with an unfinished change. Raises SafetyRefusal if another dvtcli holds the lock."""
        with self._files("read"):
            self.lock.take()

    def lock_or_refuse(self) -> bool:
        """Take the lock; true if this process did not hold the lock before, which makes earlier reads uncertain.

        Raises SafetyRefusal if another dvtcli holds the lock, or an interrupted change is unfinished.
        """
        with self._files("kept"):
            taken = not self.lock.held
            self.lock.take()
            path = self.unfinished_journal()
        if path is not None and not self.own_journal.is_open(path):
            raise SafetyRefusal(
                f"an interrupted change of node {self.node_id} is not finished yet",
                node=self.node_id,
                place=str(path),
                hint=_way_out(path),
            )
        return taken

    def begin(
        self,
        plan: Plan,
        identity: Identity,
        nmt_state: int | None,
        pdos: Callable[[], Mapping[Pdo, PdoConfig]],
        held: Mapping[Pdo, PdoConfig] | None = None,
        asked: tuple[str, ...] = (),
        *,
        is_test: bool = False,
        is_remembered: bool = True,
    ) -> None:
        """Take the lock, back up the PDOs if needed, and write the journal, before the first write of *plan*.

        A backup is needed if a PDO of *held*, as just read, is in no backup and no remembered change; *pdos* reads all
        PDOs for it. Within a group the values from before the group are backed up. The other arguments are those of
        `OwnJournal.begin`. Raises SafetyRefusal if another dvtcli has the lock, or a file cannot be written.
        """
        if is_remembered or not self.own_journal.is_begun:  # part of a begun group, or its roll-back: backed up already
            self._back_up(identity, pdos, held or {})
        room = journal_room(held or {})
        self.own_journal.begin(
            plan, identity, nmt_state, asked, is_test=is_test, is_remembered=is_remembered, room=room
        )

    def prepare(
        self,
        plan: Plan,
        identity: Identity,
        nmt_state: int | None,
        pdos: Callable[[], Mapping[Pdo, PdoConfig]],
        held: Mapping[Pdo, PdoConfig],
        group: GroupMember,
        *,
        proves: bool = False,
    ) -> None:
        """Do the work of `begin` for a whole group, before the first write to any node.

        *group* has the stores at its end; *proves* adds their tests.
        """
        self._back_up(identity, pdos, held)
        room = journal_room(held) + (ROOM_OF_TEST if proves else 0)
        self.own_journal.prepare(plan, identity, nmt_state, room=room, group=group)

    def _back_up(
        self, identity: Identity, pdos: Callable[[], Mapping[Pdo, PdoConfig]], held: Mapping[Pdo, PdoConfig]
    ) -> None:
        """Take the lock and back up all *pdos*, unless the values *held* before the group are saved already."""
        before = self.own_journal.before()
        with self._files("kept"):
            self.lock.take()
            needed = self._backing_up.needed(identity, {pdo: before.get(pdo, one) for pdo, one in held.items()})
        if needed:
            every_pdo = {**pdos(), **before}
            with self._files("kept"):
                path = self._backing_up.make(identity, every_pdo, {pdo for pdo in every_pdo if self.is_fixed(pdo)})
                self.report(f"backup of node {self.node_id}: {path}")

    def unlike_backups(self, identity: Identity, held: Mapping[Pdo, PdoConfig]) -> list[Pdo]:
        """The PDOs in *held* that match neither a backup of the device nor a remembered change."""
        with self._files("read"):
            return self._backing_up.unlike_backups(identity, held)

    def remember(self, plan: Plan) -> None:
        """Let a later `undo` revert *plan*, registered by `begin` and now verified."""
        self.history.add(plan, self.own_journal.identity, self.own_journal.entry, self.group.id or "")

    def delete_journal(self, journal: Journal, back: Plan | None = None) -> None:
        """Remove *journal*, whose change was rolled back, from its folder and, if it is the same, from ours.

        Its entries leave the history of `undo`. *back* is the roll-back if the values that it replaced are stored, or
        may be: the next store must include the present values. The journal of another change of the node stays.
        """
        with self._files("removed"):
            remove(journal.path)
        self.history.drop(self.node_id, journal.identity, journal.member.entries, back)
        self.own_journal.detach()
        with self._files("removed"):
            if self._is_gone_or(journal, self.journals.path(self.node_id)):
                self.own_journal.delete()
            elif self.unfinished_journal() is None:
                self.lock.note(None)
            JournalFolder(journal.path.parent, journal.bus).tidy(journal.member.group_id)

    def _is_gone_or(self, journal: Journal, path: Path) -> bool:
        """True if the file at *path* is missing, or is *journal* or a copy."""
        if not path.exists():
            return True
        try:
            return replace(read_journal(path), path=journal.path) == journal
        except (InputFileError, SafetyRefusal):  # another file: not recovered
            return False

    def set_aside(self, path: Path, word: str) -> Path:
        """Close the journal at *path* under a new name, which is returned; a closed journal blocks no change."""
        with self._files("set aside"):
            self.lock.take()
            closed = None
            with suppress(InputFileError, SafetyRefusal):  # what cannot be used names no group
                closed = read_journal(path)
            aside = set_aside(path, word)
            if closed is not None:
                JournalFolder(path.parent, closed.bus).tidy(closed.member.group_id)
            if self.unfinished_journal() is None:
                self.lock.note(None)
        return aside

    def _files(self, what: str) -> AbstractContextManager[None]:
        return journal_files(self.journals, self.node_id, what)


def who_else(guard: ChangeGuard | None) -> str:
    """Who may have changed the node since this process did, for display."""
    other = None if guard is None else guard.lock.meanwhile
    if other is None:
        return "it restarted, or another client wrote to it"
    return f"another dvtcli ({other}) wrote to it since"


def _way_out(path: Path) -> Hint:
    """How to finish the interrupted change with the journal at *path*."""
    try:
        journal = read_journal(path)
    except InputFileError:
        discard = Hint(Action.RECOVER, {"discard": True}, f"the journal is damaged: {{}} sets {verbatim(path)} aside")
        return discard + Hint(Action.SHOW_PDOS, why=", then check the node with {}")
    group_id = journal.member.group_id
    together = () if group_id is None else JournalFolder(path.parent, journal.bus).all_of(group_id)
    ids = sorted({journal.plan.node_id, *(other.plan.node_id for other in together)})
    what = f"rolls back all nodes of that change ({', '.join(map(str, ids))})" if len(ids) > 1 else "rolls back"
    return Hint(Action.RECOVER, why=f"{what} to the old configuration, with the journal {verbatim(path)}")


class Backup(NamedTuple):
    """A backup file with its time stamp in UTC, like `20261122T041120.123456Z`."""

    path: Path
    stamp: str

    def was_made(self, when: str) -> bool:
        """True if the time stamp starts with *when*: a date with or without a time, in any punctuation."""
        return bool(re.search(r"\d", when)) and _digits(self.stamp).startswith(_digits(when))

    def lines(self) -> list[str]:
        """The file's lines; empty if unreadable."""
        try:
            return self.path.read_text("utf-8", "replace").splitlines()
        except OSError:
            return []


def backups(folder: Path, bus: str, node_id: int, identity: Mapping[str, int | None]) -> list[Backup]:
    """The backups in *folder* for the node at *node_id* on *bus* with this *identity*, oldest first."""
    head, needed = f"{file_name(bus)}-{node_id}-", identity_line(identity)
    found = [Backup(path, path.name.removeprefix(head).removesuffix(".dvt")) for path in folder.glob(f"{head}*.dvt")]
    return sorted((backup for backup in found if _pins(backup.lines()) == needed), key=lambda backup: backup.stamp)


def of_this_device(found: Iterable[Backup], identity: Mapping[str, int | None]) -> list[Backup]:
    """Only the backups of the device with this serial number, or without a serial number."""
    line = serial_line(identity)
    return [backup for backup in found if line in (lines := backup.lines()) or not any(map(_tells_serial, lines))]


def _tells_serial(line: str) -> bool:
    return line.startswith("# serial number") or line == serial_line({})


def _pins(lines: Sequence[str]) -> str | None:
    """The line that pins the identity, empty if none does; None for a file without lines."""
    return next((line for line in lines[:5] if line.startswith("require ")), "") if lines else None


def remarks(path: Path) -> list[str]:
    """The remarks in the backup at *path* about settings not covered by the backup, such as multiplexed PDOs."""
    lines = path.read_text("utf-8", "replace").splitlines()
    return [line.removeprefix("# ") for line in lines if line.startswith("# ") and line.endswith(REMARKS)]


def _digits(text: str) -> str:
    return re.sub(r"\D", "", text)


def pdos_freeing_can_ids_first(changes: Iterable[PdoChange]) -> Iterator[PdoChange]:
    """Sort *changes* to free a CAN-ID before another PDO gets the same CAN-ID, if possible."""
    pending = list(changes)
    while pending:
        free = (
            change for change in pending if not any(_holds(other, change) for other in pending if other is not change)
        )
        chosen = next(free, pending[0])
        pending.remove(chosen)
        yield chosen


def _holds(other: PdoChange, one: PdoChange) -> bool:
    """True if *other* is enabled at present with the CAN-ID wanted for *one*."""
    held, wanted = other.before.communication.cob_id, one.after.communication.cob_id
    return held.valid and wanted.valid and (held.can_id, held.extended) == (wanted.can_id, wanted.extended)


def way_to(now: Mapping[Pdo, PdoConfig], wanted: Mapping[Pdo, PdoConfig]) -> tuple[PdoChange, ...]:
    """The changes from *now* to *wanted*, without PDOs that are equal already."""
    changes = (plan_pdo(pdo, now[pdo], config) for pdo, config in wanted.items())
    return tuple(pdos_freeing_can_ids_first([change for change in changes if change.steps]))

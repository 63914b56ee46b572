"""What stands around a change on a real bus: the lock, the backup, our own journal, and those that were left behind.

Knows files in one state folder. Does not read or write devices itself; a node hands it what it needs.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path

from dvtcli.device.backups import backups
from dvtcli.device.change.change_group import ChangeGroup, GroupMember
from dvtcli.device.change.journal import Journal, Journals, read_journal
from dvtcli.device.change.lock import NodeLock
from dvtcli.device.change.own_journal import ROOM_OF_TEST, OwnJournal, journal_files, room_beside
from dvtcli.device.change.plan_document import Identity
from dvtcli.device.change.private_file import file_name, remove, remove_unfinished, set_aside, write_private
from dvtcli.device.change_history import ChangeHistory
from dvtcli.device.trust import check_folder
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, Plan
from dvtcli.domain.script_line import backup_lines, backup_of, serial_line
from dvtcli.errors import InputFileError, SafetyRefusal


@dataclass(slots=True)
class BackingUp:
    """The backups in *folder* of the node at *node_id* on *bus*; *past* are the changes that `undo` remembers of it."""

    folder: Path
    bus: str
    node_id: int
    past: ChangeHistory

    def needed(self, identity: Identity, held: Mapping[Pdo, PdoConfig]) -> bool:
        """Whether there is no backup of this very device, or one of the PDOs *held* is as nothing that is kept says.

        SafetyRefusal where somebody else can write there.
        """
        made = self._made(identity)
        unlike = [(pdo, config) for pdo, config in held.items() if not _is_in(made, pdo, config)]
        return not made or (bool(unlike) and not self._remembered(identity) >= set(unlike))

    def unlike_kept(self, identity: Identity, held: Mapping[Pdo, PdoConfig]) -> list[Pdo]:
        """The PDOs *held* that are as no backup of this very device and no remembered change says.

        SafetyRefusal if somebody else can write where the backups are.
        """
        made, remembered = self._made(identity), self._remembered(identity)
        return [
            pdo for pdo, config in held.items() if (pdo, config) not in remembered and not _is_in(made, pdo, config)
        ]

    def _made(self, identity: Identity) -> list[set[str]]:
        """The backups of this very device, by their lines."""
        check_folder(self.folder)
        made = [set(backup.lines()) for backup in backups(self.folder, self.bus, self.node_id, identity)]
        return [lines for lines in made if serial_line(identity) in lines]

    def _remembered(self, identity: Identity) -> set[tuple[Pdo, PdoConfig]]:
        """What PDOs held before and after the changes that `undo` remembers; nothing where their file is damaged."""
        try:
            entries = self.past.entries(self.node_id, identity)
        except InputFileError:  # the next change sets it aside, and says so
            return set()
        changes = (change for entry in entries for change in entry.plan.changes if isinstance(change, PdoChange))
        return {(change.pdo, config) for change in changes for config in (change.before, change.after)}

    def make(self, identity: Identity, pdos: Mapping[Pdo, PdoConfig], fixed: Collection[Pdo]) -> Path:
        """Keep *pdos*, which are all that the device has, and say where; the COB-IDs of *fixed* cannot be written."""
        stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
        path = self.folder / f"{file_name(self.bus)}-{self.node_id}-{stamp}.dvt"
        write_private(path, "\n".join(backup_lines(identity, pdos, fixed)) + "\n")
        return path


def _is_in(made: Collection[set[str]], pdo: Pdo, config: PdoConfig) -> bool:
    """Whether one of the backups *made*, by their lines, would set *pdo* to *config*."""
    return any(lines.issuperset(backup_of(pdo, config)) for lines in made)


@dataclass(slots=True)
class ChangeGuard:
    """The files of one node on the bus called *bus*: journals and backups below *folder*, locks in *locks*.

    The locks' folder is the same for every dvtcli of a user, or they would not see each other. *say* shows a message.
    """

    folder: Path
    locks: Path
    bus: str
    node_id: int
    say: Callable[[str], None] = lambda _text: None
    #: whether a PDO's COB-ID is known to be read-only
    is_fixed: Callable[[Pdo], bool] = lambda _pdo: False
    #: shows what nobody may miss, also where results are documents
    warn: Callable[[str], None] = lambda _text: None
    #: the command that this process runs, for another dvtcli that waits for the lock
    command: Callable[[], str] = lambda: ""
    #: what the changes that are made now belong to
    whole: ChangeGroup = field(default_factory=ChangeGroup)
    lock: NodeLock = field(init=False)
    journals: Journals = field(init=False)
    #: the journal of what this process changes
    own_journal: OwnJournal = field(init=False)
    #: the changes that a later process can put back
    past: ChangeHistory = field(init=False)
    _backing_up: BackingUp = field(init=False)

    def __post_init__(self) -> None:
        self.lock = NodeLock(self.locks, self.bus, self.node_id, self.command, self._remove_unfinished)
        self.journals = Journals(self.folder / "journals", self.bus)
        self.own_journal = OwnJournal(self.journals, self.lock, self.whole, self.warn)
        self.past = ChangeHistory(self.locks.parent / "changes", self.bus, self.warn)
        self._backing_up = BackingUp(self.folder / "backups", self.bus, self.node_id, self.past)

    def _remove_unfinished(self) -> None:
        """Remove what a killed process left half written of this node's files: who has the lock is the only writer."""
        own = self.journals.path(self.node_id)
        remove_unfinished(own.parent, own.name)
        remove_unfinished(self.folder / "backups", f"{own.stem}-*.dvt")
        remove_unfinished(self.past.folder, f"{file_name(self.bus)}-*-node{self.node_id}.json")

    def open_journal(self) -> Path | None:
        """Where the journal of an unfinished change is: in our own folder, or where another dvtcli noted it."""
        with self._files("read"):
            own, noted = self.journals.path(self.node_id), self.lock.noted()
            if noted is not None and not self.journals.is_named(noted, self.node_id):
                noted = None
            return next((path for path in (own, noted) if path is not None and self.journals.counts(path)), None)

    def interrupted(self) -> Journal | None:
        """The journal of a change that nobody is working on any more, or None; InputFileError where it is damaged."""
        with self._files("read"):
            path = self.open_journal()
            if path is None or not self.lock.is_free():
                return None
            try:
                return read_journal(path)
            except InputFileError:
                if path.exists():
                    raise
                return None  # who was at work a moment ago has ended its change

    def held_journal(self) -> Path | None:
        """As `open_journal`, with the lock taken first: a change that is under way is not an interrupted one.

        SafetyRefusal where another dvtcli is at work. The lock is kept only where there is a journal.
        """
        taken = not self.lock.held
        self.hold()
        with self._files("read"):
            path = self.open_journal()
        if taken and path is None:
            self.lock.release()
        return path

    def hold(self) -> None:
        """Take the lock, whatever waits to be finished; SafetyRefusal where another dvtcli has it."""
        with self._files("read"):
            self.lock.take()

    def refuse_while_open(self) -> bool:
        """Take the lock, and say whether that was needed: nothing that was read before is certain then.

        SafetyRefusal where another dvtcli has it, or an interrupted change waits to be finished.
        """
        with self._files("kept"):
            taken = not self.lock.held
            self.lock.take()
            path = self.open_journal()
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
        is_kept: bool = True,
    ) -> None:
        """Before the first write of *plan*: take the lock, back the PDOs up where needed, put the journal on disk.

        *held* are PDOs as they were just read, by which it is seen whether a backup is needed; *pdos* reads all of
        them, for a backup only. Where *plan* goes on with a whole, or takes it back, what that changed counts as it was
        before. *asked* are the PDOs that `learn` asks, where it does; *is_test* says that *plan* only tests a store,
        *is_kept* that `undo` is to remember it.
        """
        if is_kept or not self.own_journal.is_begun:  # a part of what was begun, or its way back: that is backed up
            self._back_up(identity, pdos, held or {})
        room = room_beside(held or {})
        self.own_journal.begin(plan, identity, nmt_state, asked, is_test=is_test, is_kept=is_kept, room=room)

    def prepare(
        self,
        plan: Plan,
        identity: Identity,
        nmt_state: int | None,
        pdos: Callable[[], Mapping[Pdo, PdoConfig]],
        held: Mapping[Pdo, PdoConfig],
        ends: GroupMember,
        *,
        proves: bool = False,
    ) -> None:
        """Before the first write to any node of a whole: what `begin` does, for all of *plan* and what follows it.

        *ends* has the stores that end the whole; with *proves* they are tested.
        """
        self._back_up(identity, pdos, held)
        room = room_beside(held) + (ROOM_OF_TEST if proves else 0)
        self.own_journal.prepare(plan, identity, nmt_state, room=room, ends=ends)

    def _back_up(
        self, identity: Identity, pdos: Callable[[], Mapping[Pdo, PdoConfig]], held: Mapping[Pdo, PdoConfig]
    ) -> None:
        """Take the lock, and keep all *pdos* unless what the node *held* before the whole is kept already."""
        before = self.own_journal.before()
        with self._files("kept"):
            self.lock.take()
            needed = self._backing_up.needed(identity, {pdo: before.get(pdo, one) for pdo, one in held.items()})
        if needed:
            whole = {**pdos(), **before}
            with self._files("kept"):
                path = self._backing_up.make(identity, whole, {pdo for pdo in whole if self.is_fixed(pdo)})
                self.say(f"backup of node {self.node_id}: {path}")

    def unlike_kept(self, identity: Identity, held: Mapping[Pdo, PdoConfig]) -> list[Pdo]:
        """The PDOs *held* that are as no backup of the device and no remembered change says."""
        with self._files("read"):
            return self._backing_up.unlike_kept(identity, held)

    def remember(self, plan: Plan) -> None:
        """After *plan*, which `begin` was told of, was carried out and verified: a later `undo` can put it back."""
        self.past.add(plan, self.own_journal.identity, self.own_journal.entry)

    def forget(self, journal: Journal, back: Plan | None = None) -> None:
        """After *journal* was recovered, wherever it was kept; that of another change of the node stays.

        *back* is what was put back, where what it replaced is stored, or may be: the next store is to know of it.
        """
        with self._files("removed"):
            remove(journal.path)
        self.past.drop(self.node_id, journal.identity, journal.part.entries, back)
        self.own_journal.detach()
        with self._files("removed"):
            if self._is_gone_or(journal, self.journals.path(self.node_id)):
                self.own_journal.forget()
            elif self.open_journal() is None:
                self.lock.note(None)
            Journals(journal.path.parent, journal.bus).tidy(journal.part.whole)

    def _is_gone_or(self, journal: Journal, path: Path) -> bool:
        """Whether the file at *path* is no other journal than *journal*, of which it may be a copy."""
        if not path.exists():
            return True
        try:
            return replace(read_journal(path), path=journal.path) == journal
        except (InputFileError, SafetyRefusal):  # whatever it is, it was not recovered
            return False

    def set_aside(self, path: Path, word: str) -> Path:
        """Close the journal at *path*: it blocks nothing any more, and is kept under the name that is returned."""
        with self._files("set aside"):
            self.lock.take()
            closed = None
            with suppress(InputFileError, SafetyRefusal):  # what cannot be used names no whole
                closed = read_journal(path)
            aside = set_aside(path, word)
            if closed is not None:
                Journals(path.parent, closed.bus).tidy(closed.part.whole)
            if self.open_journal() is None:
                self.lock.note(None)
        return aside

    def _files(self, what: str) -> AbstractContextManager[None]:
        return journal_files(self.journals, self.node_id, what)


def who_else(keeper: ChangeGuard | None) -> str:
    """Who may have changed what this process left, for people."""
    other = None if keeper is None else keeper.lock.meanwhile
    if other is None:
        return "it restarted, or somebody else wrote to it"
    return f"another dvtcli ({other}) wrote to it since"


def _way_out(path: Path) -> Hint:
    """How the change whose journal is at *path* is finished."""
    try:
        read_journal(path)
    except InputFileError:
        discard = Hint(Action.RECOVER, {"discard": True}, f"the journal is damaged: {{}} sets {verbatim(path)} aside")
        return discard + Hint(Action.SHOW_PDOS, why=", then look at the node with {}")
    return Hint(Action.RECOVER, why=f"puts the old configuration back, from {verbatim(path)}")

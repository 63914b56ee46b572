"""What stands around a change on a real bus: the lock, the backup, and the journal.

Knows files in one state folder. Does not read or write devices itself; a node hands it what it needs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from dvtcli.device.change.backing_up import BackingUp
from dvtcli.device.change.course import Course
from dvtcli.device.change.journal import Journal, Journals, read_journal
from dvtcli.device.change.lock import NodeLock
from dvtcli.device.change.plan_document import Identity
from dvtcli.device.change.private_file import set_aside
from dvtcli.device.change.whole import Whole
from dvtcli.device.past import Past
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Plan
from dvtcli.errors import InputFileError, JournalKept, SafetyRefusal


@dataclass(slots=True)
class Keeper:
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
    whole: Whole = field(default_factory=Whole)
    lock: NodeLock = field(init=False)
    journals: Journals = field(init=False)
    #: the changes that a later process can put back
    past: Past = field(init=False)
    _backing_up: BackingUp = field(init=False)
    _identity: Identity = field(default_factory=dict)
    #: what the journal that is ours has to put back
    _course: Course = field(default_factory=Course)
    #: the id under which `undo` is to remember the change in hand
    _entry: str = ""

    def __post_init__(self) -> None:
        self.lock = NodeLock(self.locks, self.bus, self.node_id, self.command)
        self.journals = Journals(self.folder / "journals", self.bus)
        self.past = Past(self.locks.parent / "changes", self.bus, self.warn)
        self._backing_up = BackingUp(self.folder / "backups", self.bus, self.node_id, self.past)

    def open_journal(self) -> Path | None:
        """Where the journal of an unfinished change is: in our own folder, or where another dvtcli noted it."""
        own, noted = self.journals.path(self.node_id), self.lock.noted()
        return next((path for path in (own, noted) if path is not None and self.journals.counts(path)), None)

    def interrupted(self) -> Journal | None:
        """The journal of a change that nobody is working on any more, or None; InputFileError where it is damaged."""
        with self._files("read"):
            path = self.open_journal()
            return read_journal(path) if path is not None and self.lock.is_free() else None

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
        if path is not None and not self._is_open(path):
            raise SafetyRefusal(
                f"an interrupted change of node {self.node_id} is not finished yet",
                node=self.node_id,
                place=str(path),
                hint=_way_out(path),
            )
        return taken

    def _is_open(self, path: Path) -> bool:
        """Whether the journal at *path* is that of a whole of ours which is not complete yet."""
        course = self._course
        ours = course.made and course.in_hand is None and course.part.whole == self.whole.id
        return bool(ours) and path == self.journals.path(self.node_id)

    def begin(
        self,
        plan: Plan,
        identity: Identity,
        nmt_state: int | None,
        pdos: Callable[[], Mapping[Pdo, PdoConfig]],
        held: Mapping[Pdo, PdoConfig] | None = None,
    ) -> None:
        """Before the first write of *plan*: take the lock, back the PDOs up where needed, put the journal on disk.

        *held* are PDOs as they were just read, by which it is seen whether a backup is needed; *pdos* reads all of
        them, for a backup only.
        """
        self._identity = identity
        with self._files("kept"):
            self.lock.take()
            needed = self._backing_up.needed(identity, held or {})
        whole = pdos() if needed else {}
        with self._files("kept"):
            if needed:
                path = self._backing_up.make(identity, whole, {pdo for pdo in whole if self.is_fixed(pdo)})
                self.say(f"backup of node {self.node_id}: {path}")
            if self.whole.id is not None:
                self.journals.open_whole(self.whole.id)
            self._entry = self._course.begin(self.whole, plan, nmt_state)
            try:
                self.lock.note(self._write())
            except OSError:  # nothing of this is written to the device: there is nothing to recover
                self._course.in_hand = None
                if not self._course.made:
                    self.journals.path(self.node_id).unlink(missing_ok=True)
                raise

    def _write(self) -> Path:
        course = self._course
        return self.journals.write(course.plan, self._identity, course.nmt_state, course.part)

    def note(self, plan: Plan) -> None:
        """Put *plan* on disk in place of the one in hand: more than that has to be put back."""
        with self._files("kept"):
            self._course.in_hand = plan
            self._write()

    def carried_out(self) -> None:
        """The change in hand was verified."""
        self._course.carried_out()

    def end(self) -> None:
        """After the change was verified, or undone and verified: forget the journal, unless it is that of a whole."""
        self._course.in_hand = None
        if self._course.made:  # what it says of the change in hand is so, also where that was undone
            return
        self._forget()

    def final(self, line: str) -> None:
        """Before *line* of the whole, which no undo reverts; empty: it was not done after all."""
        if self._course.made:
            self._course.part = replace(self._course.part, final=line)
            if line:
                with self._files("kept"):
                    self._write()

    def complete_whole(self) -> None:
        """The whole is complete, on every node from now on: forget the journal. JournalKept where that fails."""
        if self.whole.id is not None:
            try:
                self.journals.close_whole(self.whole.id)
            except OSError as failed:
                raise self._kept(self.journals.path(self.node_id), failed) from failed
        self.end_whole()

    def abandon_whole(self) -> None:
        """The whole is not complete; what of it could not be put back waits for `recover`."""
        self._tidy(self.journals, self.whole.id)

    def _tidy(self, journals: Journals, whole: str | None) -> None:
        """After a journal of *whole* is gone: so is what the last one needed."""
        if whole is not None and not journals.all_of(whole):
            with self._files("removed"):
                journals.close_whole(whole)

    def end_whole(self) -> None:
        """This node's part of the whole was put back and verified: forget the journal."""
        if self._course.made and self._course.in_hand is None:
            whole, self._course = self._course.part.whole, Course()
            self._forget()
            self._tidy(self.journals, whole)

    def _forget(self) -> None:
        """Remove the journal.

        JournalKept where it is still there. That it is gone for good (it might come back after a power failure), or
        that the lock still names it, is a message only: `recover` asks before it does anything.
        """
        path = self.journals.path(self.node_id)
        try:
            path.unlink(missing_ok=True)
        except OSError as failed:
            raise self._kept(path, failed) from failed
        try:
            self.journals.remove(self.node_id)
            self.lock.note(None)
        except OSError as failed:
            self.warn(f"the state folder takes nothing more ({failed.strerror or failed}): {failed.filename or path}")

    def _kept(self, path: Path, failed: OSError) -> JournalKept:
        error = JournalKept(
            f"the journal of node {self.node_id} cannot be removed",
            node=self.node_id,
            place=str(path),
            why=failed.strerror or str(failed),
            hint=f"delete {path}: nothing is to be recovered, and until then nothing can be written to the node",
            state="left_changed",
        )
        error.state_text = "as planned: set and read back equal; `recover` would put the old configuration back"
        return error

    def remember(self, plan: Plan) -> None:
        """After *plan*, which `begin` was told of, was carried out and verified: a later `undo` can put it back."""
        self.past.add(plan, self._identity, self._entry)

    def forget(self, journal: Journal) -> None:
        """After *journal* was recovered, wherever it was kept; that of another change of the node stays."""
        with self._files("removed"):
            journal.path.unlink(missing_ok=True)
        self.past.drop(self.node_id, journal.identity, journal.part.entries)
        self._course = Course()
        if self._is_gone_or(journal, self.journals.path(self.node_id)):
            self._forget()
        elif self.open_journal() is None:
            self.lock.note(None)
        self._tidy(Journals(journal.path.parent, journal.bus), journal.part.whole)

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
            aside = set_aside(path, word)
            if self.open_journal() is None:
                self.lock.note(None)
        return aside

    @contextmanager
    def _files(self, what: str) -> Iterator[None]:
        """A disk that is full or a folder that may not be written is the user's to mend, not a bug of ours."""
        try:
            yield
        except OSError as failed:
            raise SafetyRefusal(
                f"the journal of node {self.node_id} cannot be {what}: {failed.strerror or failed}",
                node=self.node_id,
                place=str(failed.filename or self.folder),
                hint="--journal DIR takes another folder; without a journal nothing is written to a real device",
            ) from failed


def who_else(keeper: Keeper | None) -> str:
    """Who may have changed what this process left, for people."""
    other = None if keeper is None else keeper.lock.meanwhile
    if other is None:
        return "it restarted, or somebody else wrote to it"
    return f"another dvtcli ({other}) wrote to it since"


def _way_out(path: Path) -> str:
    """How the change whose journal is at *path* is finished."""
    try:
        read_journal(path)
    except InputFileError:
        return f"the journal is damaged: recover --discard sets {path} aside, then look at the node with `pdo`"
    return f"recover puts the old configuration back, from {path}"

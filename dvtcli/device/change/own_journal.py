"""The journal of what this process changes on one node: there before the first write, until nothing is to be put back.

That of a whole grows with each of its changes. Does not know journals that others left, backups, or devices.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from dvtcli.device.change.course import Course, combined, covers
from dvtcli.device.change.journal import Journal, Journals
from dvtcli.device.change.lock import NodeLock
from dvtcli.device.change.plan_document import Identity
from dvtcli.device.change.private_file import remove
from dvtcli.device.change.whole import Part, Storing, Whole
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, Plan
from dvtcli.errors import JournalKept, SafetyRefusal


@dataclass(slots=True)
class OwnJournal:
    """Our journal of the node whose *lock* is ours to take, among *journals*; *whole* is what our changes belong to.

    *warn* shows what nobody may miss.
    """

    journals: Journals
    lock: NodeLock
    whole: Whole
    warn: Callable[[str], None]
    #: of the device that is changed
    identity: Identity = field(default_factory=dict)
    #: the id under which `undo` is to remember the change in hand
    entry: str = ""
    #: what has to be put back
    _course: Course = field(default_factory=Course)
    #: what the parts that follow come to, and whether one of them was begun
    _announced: Plan | None = None
    _goes_on: bool = False
    #: what the node holds besides and the changes may alter, each as a change to what it is
    _beside: Plan | None = None
    #: what the journal says by now
    _on_disk: tuple[Plan, Part] | None = None

    @property
    def path(self) -> Path:
        """Where it is, whether there is one or not."""
        return self.journals.path(self.lock.node_id)

    def is_open(self, path: Path) -> bool:
        """Whether the journal at *path* is that of a whole of ours which is not complete yet."""
        course = self._course
        ours = course.made and course.in_hand is None and course.part.whole == self.whole.id
        return bool(ours) and path == self.path

    @property
    def is_begun(self) -> bool:
        """Whether a change was carried out that it tells of."""
        return bool(self._course.made)

    @property
    def says_stores(self) -> bool:
        """Whether it tells of stores that end the whole."""
        return bool(self._course.part.stores)

    def before(self) -> dict[Pdo, PdoConfig]:
        """What the PDOs of the journal of a whole that is not complete yet held before any of its changes."""
        course = self._course
        if not course.made or course.part.whole != self.whole.id:
            return {}
        kept = () if self._on_disk is None else self._on_disk[0].changes  # also what the changes may alter beside
        changes = (*kept, *course.plan.changes)
        return {change.pdo: change.before for change in changes if isinstance(change, PdoChange)}

    def announce(self, plan: Plan | None) -> None:
        """The changes that follow are parts of *plan*: its journal is written before the first one, for all of them.

        None: they stand by themselves again.
        """
        self._announced, self._goes_on = plan, False

    def guard(self, plan: Plan | None) -> None:
        """From now on the journal also has *plan*: what the node holds that the changes may alter."""
        self._beside = plan

    def begin(
        self,
        plan: Plan,
        identity: Identity,
        nmt_state: int | None,
        asked: tuple[str, ...] = (),
        *,
        is_test: bool = False,
    ) -> None:
        """Before the first write of *plan*, of the device of this *identity*: put the journal on disk.

        *asked* are the PDOs that `learn` asks, where it does; *is_test* says that it only tests a store.
        """
        self.identity = identity
        with self._files("kept"):
            if self.whole.id is not None:
                self.journals.open_whole(self.whole.id)
            self.entry = self._course.begin(self.whole, plan, nmt_state, asked, goes_on=self._goes_on, is_test=is_test)
            self._goes_on = self._announced is not None
            try:
                self.lock.note(self.path if self._is_kept() else self._write())
            except (OSError, SafetyRefusal):  # nothing of this is written to the device: there is nothing to recover
                self._course.in_hand = None
                if not self._course.made:
                    self._on_disk = None
                    remove(self.path)
                raise

    def _is_kept(self) -> bool:
        """Whether the journal says all that has to be put back."""
        return (
            self._on_disk is not None
            and self._on_disk[1] == self._course.part
            and covers(self._on_disk[0], self._course.plan)
        )

    def _write(self) -> Path:
        course, plan = self._course, self._course.plan
        if self._announced is not None:
            ahead = combined(plan.node_id, [*course.made, self._announced])
            plan = ahead if covers(ahead, plan) else plan
        if self._beside is not None:
            plan = combined(plan.node_id, [self._beside, plan])
        self._on_disk = None
        path = self.journals.write(plan, self.identity, course.nmt_state, course.part)
        self._on_disk = (plan, course.part)
        return path

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
        self._course.end_test()
        if self._course.made:  # what it says of the change in hand is so, also where that was undone
            return
        self.forget()

    def adopt(self, journal: Journal) -> None:
        """*journal*, of a whole that another process left verified on every node, is ours to complete now."""
        self.identity = journal.identity
        self._course, self._on_disk = Course(journal.nmt_state, journal.part, [journal.plan]), None
        self._announced, self._goes_on = None, False

    def final(self, line: str, stores: tuple[Storing, ...] = (), equal: tuple[Storing, ...] = ()) -> None:
        """Before *line* of the whole, which no undo reverts, and *stores* those of it; empty: not done after all.

        *equal* are the nodes that were as wanted already, and neither are changed nor store.
        """
        if self._course.made:
            self._course.part = replace(self._course.part, final=line, stores=stores, equal=equal)
            if line:
                with self._files("kept"):
                    self._write()

    def complete_whole(self) -> None:
        """The whole is complete, on every node from now on: forget the journal. JournalKept where that fails."""
        if self.whole.id is not None:
            try:
                self.journals.close_whole(self.whole.id)
            except OSError as failed:
                raise self._kept(failed) from failed
        self.end_whole()

    def abandon_whole(self) -> None:
        """The whole is not complete; what of it could not be put back waits for `recover`."""
        self._tidy(self.whole.id)

    def _tidy(self, whole: str | None) -> None:
        with self._files("removed"):
            self.journals.tidy(whole)

    def end_whole(self) -> None:
        """This node's part of the whole was put back and verified: forget the journal."""
        if self._course.made and self._course.in_hand is None:
            whole = self._course.part.whole
            self.forget()
            self._tidy(whole)

    def is_over(self) -> None:
        """Nothing of what this process changed has to be put back any more; whatever is on disk stays there."""
        self._course, self._on_disk = Course(), None
        self._announced, self._goes_on, self._beside = None, False, None

    def forget(self) -> None:
        """Remove the journal: nothing has to be put back any more.

        JournalKept where it is still there. That it is gone for good (it might come back after a power failure), or
        that the lock still names it, is a message only: `recover` asks before it does anything.
        """
        self.is_over()
        path = self.path
        try:
            remove(path)
        except OSError as failed:
            raise self._kept(failed) from failed
        try:
            self.journals.remove(self.lock.node_id)
            self.lock.note(None)
        except OSError as failed:
            self.warn(f"the state folder takes nothing more ({failed.strerror or failed}): {failed.filename or path}")

    def _kept(self, failed: OSError) -> JournalKept:
        node_id = self.lock.node_id
        error = JournalKept(
            f"the journal of node {node_id} cannot be removed",
            node=node_id,
            place=str(self.path),
            why=failed.strerror or str(failed),
            hint=f"delete {self.path}: nothing is to be recovered, and until then nothing can be written to the node",
            state="left_changed",
        )
        error.state_text = "as planned: set and read back equal; a recovery would put the old configuration back"
        return error

    def _files(self, what: str) -> AbstractContextManager[None]:
        return journal_files(self.journals, self.lock.node_id, what)


def complete_wholes(journals: Iterable[OwnJournal]) -> JournalKept | None:
    """Everything stays: `complete_whole` of all *journals*; the first that cannot be removed, with the others beside.

    Those of the other nodes are removed all the same.
    """
    kept: list[JournalKept] = []
    for journal in journals:
        try:
            journal.complete_whole()
        except JournalKept as failed:
            kept.append(failed)
    if not kept:
        return None
    kept[0].details += [("also", other.text) for other in kept[1:]]
    return kept[0]


@contextmanager
def journal_files(journals: Journals, node_id: int, what: str) -> Iterator[None]:
    """A disk that is full or a folder that may not be written is the user's to mend, not a bug of ours."""
    try:
        yield
    except OSError as failed:
        raise SafetyRefusal(
            f"the journal of node {node_id} cannot be {what}: {failed.strerror or failed}",
            node=node_id,
            place=str(failed.filename or journals.folder.parent),
            hint=Hint(
                Action.GIVE_JOURNAL, why="takes another folder; without a journal nothing is written to a real device"
            ),
        ) from failed

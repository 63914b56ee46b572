"""The journal of what this process changes on one node: there before the first write, until nothing is to be put back.

That of a whole grows with each of its changes, or has all of them from the start (`prepare`): what follows then takes
no more space. Does not know journals that others left, backups, or devices.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from dvtcli.device.change.change_group import ChangeGroup, GroupMember, Storing
from dvtcli.device.change.course import JournalContents, combine_plans, covers
from dvtcli.device.change.journal import Journal, Journals
from dvtcli.device.change.lock import NodeLock
from dvtcli.device.change.plan_document import Identity, change_document
from dvtcli.device.change.private_file import remove
from dvtcli.device.trust import OTHER_STATE
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, Plan, plan_pdo
from dvtcli.errors import JournalKept, SafetyRefusal

#: how many bytes the words of a journal grow by, and one of its PDOs that is held otherwise than it was
_ROOM, _MORE = 500, 100
#: and what a test of a store changes for a moment
ROOM_OF_TEST = 5000


@dataclass(slots=True)
class OwnJournal:
    """Our journal of the node whose *lock* is ours to take, among *journals*; *whole* is what our changes belong to.

    *warn* shows what nobody may miss.
    """

    journals: Journals
    lock: NodeLock
    whole: ChangeGroup
    warn: Callable[[str], None]
    #: of the device that is changed
    identity: Identity = field(default_factory=dict)
    #: the id under which `undo` is to remember the change in hand
    entry: str = ""
    #: what has to be put back
    _course: JournalContents = field(default_factory=JournalContents)
    #: what the node holds besides and the changes may alter, each as a change to what it is
    _beside: Plan | None = None
    #: what the journal says by now
    _on_disk: tuple[Plan, GroupMember] | None = None

    @property
    def path(self) -> Path:
        """Where it is, whether there is one or not."""
        return self.journals.path(self.lock.node_id)

    def is_open(self, path: Path) -> bool:
        """Whether the journal at *path* is that of a whole of ours which is not complete yet."""
        course = self._course
        ours = course.is_begun and course.in_hand is None and course.part.whole == self.whole.id
        return ours and path == self.path

    @property
    def is_begun(self) -> bool:
        """Whether it tells of a change that was carried out, or is to be, with others."""
        return self._course.is_begun

    @property
    def says_stores(self) -> bool:
        """Whether it tells of stores that end the whole."""
        return bool(self._course.part.stores)

    def before(self) -> dict[Pdo, PdoConfig]:
        """What the PDOs of the journal of a whole that is not complete yet held before any of its changes."""
        course = self._course
        if not course.is_begun or course.part.whole != self.whole.id:
            return {}
        kept = () if self._on_disk is None else self._on_disk[0].changes  # also what the changes may alter beside
        changes = (*kept, *course.plan.changes)
        return {change.pdo: change.before for change in changes if isinstance(change, PdoChange)}

    def guard(self, plan: Plan | None) -> None:
        """From now on the journal also has *plan*: what the node holds that the changes may alter."""
        self._beside = plan

    def prepare(self, plan: Plan, identity: Identity, nmt_state: int | None, *, room: int, ends: GroupMember) -> None:
        """Before the first write to any node of a whole: put the journal of all of *plan* on disk.

        What is written to it until the whole is over needs no more space: *room* is how many bytes its later forms may
        need, beside those that say how far the stores of *ends* are. SafetyRefusal if it cannot be kept.
        """
        before, self.identity = self._copy(), identity
        with self._files("kept"):
            self.entry = self._course.prepare(self.whole, plan, nmt_state)
            self._keep_or(before, room + Journals.length_of(ends.final, (*ends.stores, *ends.equal)))

    def begin(
        self,
        plan: Plan,
        identity: Identity,
        nmt_state: int | None,
        asked: tuple[str, ...] = (),
        *,
        is_test: bool = False,
        is_kept: bool = True,
        room: int = 0,
    ) -> None:
        """Before the first write of *plan*, of the device of this *identity*: put the journal on disk.

        *asked* are the PDOs that `learn` asks, where it does; *is_test* says that it only tests a store, *is_kept* that
        `undo` is to remember it. What is not, and is put back by what is on disk already, needs no space. *room* is how
        many bytes its later forms may need.
        """
        before, self.identity = self._copy(), identity
        covered = not (is_kept or is_test or asked) and self._course.is_begun and self._puts_back(plan)
        if covered and self._on_disk is not None and self._on_disk[1] == self._course.part:
            self._course.in_hand = plan
            return
        with self._files("kept"):
            self.entry = self._course.begin(self.whole, plan, nmt_state, asked, is_test=is_test)
            try:
                self._keep_or(before, room if is_kept else 0)
            except (OSError, SafetyRefusal):
                if not covered:
                    raise
                self._course.in_hand = plan  # what is on disk puts this back, too

    def _copy(self) -> JournalContents:
        return replace(self._course, made=[*self._course.made])

    def _keep_or(self, before: JournalContents, room: int) -> None:
        """Put the journal on disk and note it; if that fails nothing of it is written to the device: as *before*."""
        try:
            if self.whole.id is not None:
                self.journals.open_whole(self.whole.id)
            self._write(room)
            self.lock.note(self.path)
        except BaseException:
            self._course = before
            if not before.is_begun:
                self._on_disk = None
                remove(self.path)
                with suppress(OSError):
                    self.journals.tidy(self.whole.id)
            raise

    def _puts_back(self, plan: Plan) -> bool:
        """Whether the journal, as it is on disk, has all that *plan* writes as it was before the whole."""
        if self._on_disk is None or self._course.part.whole != self.whole.id:
            return False
        return covers(self._on_disk[0], combine_plans(plan.node_id, [self._course.plan, plan]))

    def _guarded(self) -> Plan:
        """All that has to be put back, and what the node holds that the changes may alter."""
        plan = self._course.plan
        return plan if self._beside is None else combine_plans(plan.node_id, [self._beside, plan])

    def _write(self, room: int = 0) -> None:
        plan = self._guarded()
        self.journals.write(plan, self.identity, self._course.nmt_state, self._course.part, room=room)
        self._on_disk = (plan, self._course.part)

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
        if self._course.is_begun:  # what it says of the change in hand is so, also where that was undone
            return
        self.forget()

    def adopt(self, journal: Journal) -> None:
        """*journal*, of a whole that another process left verified on every node, is ours to complete now."""
        self.identity = journal.identity
        self._course = JournalContents(journal.nmt_state, journal.part, [journal.plan])
        self._on_disk = (journal.plan, journal.part)

    def final(self, line: str, stores: tuple[Storing, ...] = (), equal: tuple[Storing, ...] = ()) -> None:
        """Before *line* of the whole, which no undo reverts, and *stores* those of it; empty: not done after all.

        *equal* are the nodes that were as wanted already, and neither are changed nor store.
        """
        if self._course.is_begun:
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
        if self._course.is_begun and self._course.in_hand is None:
            whole = self._course.part.whole
            self.forget()
            self._tidy(whole)

    def detach(self) -> None:
        """Nothing of what this process changed has to be put back any more; whatever is on disk stays there."""
        self._course, self._on_disk, self._beside = JournalContents(), None, None

    def forget(self) -> None:
        """Remove the journal: nothing has to be put back any more.

        JournalKept where it is still there. That it is gone for good (it might come back after a power failure), or
        that the lock still names it, is a message only: `recover` asks before it does anything.
        """
        self.detach()
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


def room_beside(held: Mapping[Pdo, PdoConfig]) -> int:
    """How many bytes more a journal may need: for its words, and for the PDOs *held*, should a device alter them."""
    return _ROOM + sum(len(json.dumps(change_document(plan_pdo(pdo, one, one)))) + _MORE for pdo, one in held.items())


@contextmanager
def journal_files(journals: Journals, node_id: int, what: str) -> Iterator[None]:
    """A disk that is full or a folder that may not be written is the user's to mend, not a bug of ours."""
    try:
        yield
    except OSError as failed:
        place, moved = Path(failed.filename or journals.folder.parent), journals.folder.parent
        moves = place == moved or {journals.folder, moved / "backups"} & {place, *place.parents}
        needed = "without a journal nothing is written to a real device"
        shared = f"make room or mend it; {OTHER_STATE}, with the locks" if OTHER_STATE else "make room or mend it"
        raise SafetyRefusal(
            f"the journal of node {node_id} cannot be {what}: {failed.strerror or failed}",
            node=node_id,
            place=str(place),
            hint=Hint(Action.GIVE_JOURNAL, why=f"takes another folder; {needed}") if moves else f"{shared}; {needed}",
        ) from failed

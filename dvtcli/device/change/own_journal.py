"""The journal of this process for one node, from before the first write until nothing must be rolled back.

The journal of a group grows with each change, or contains all changes from the start (`prepare`) and needs no more
space.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from dvtcli.device.change.change_group import ChangeGroup, GroupMember, Storing
from dvtcli.device.change.combined_plan import ChangesToRollBack, combine_plans, covers
from dvtcli.device.change.journal import Journal, JournalFolder
from dvtcli.device.change.lock import NodeLock
from dvtcli.device.change.plan_document import Identity, change_document
from dvtcli.device.change.private_file import OTHER_STATE, remove
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, Plan, plan_pdo
from dvtcli.errors import JournalKept, SafetyRefusal

#: how many bytes the words of a journal grow by, and one of its PDOs that is held otherwise than it was
_ROOM, _MORE = 500, 100
#: and what a test of a store changes for a moment
ROOM_OF_TEST = 5000


@dataclass(slots=True, eq=False, repr=False)
class OwnJournal:
    """The journal of this process for the node of *lock*, among *journals*; *group* is the current change group.

    *warn* shows an important message.
    """

    journals: JournalFolder
    lock: NodeLock
    group: ChangeGroup
    warn: Callable[[str], None]
    #: the identity of the changed device
    identity: Identity = field(default_factory=dict)
    #: the id under which `undo` is to remember the change in hand
    entry: str = ""
    #: the changes to roll back
    _contents: ChangesToRollBack = field(default_factory=ChangesToRollBack)
    #: values possibly altered as a side effect, each as a change to its present value
    _may_be_altered: Plan | None = None
    #: the present content of the journal
    _on_disk: tuple[Plan, GroupMember] | None = None

    @property
    def path(self) -> Path:
        """The path of the journal, existing or not."""
        return self.journals.path(self.lock.node_id)

    def is_open(self, path: Path) -> bool:
        """True if *path* is the journal of our own incomplete group."""
        contents = self._contents
        ours = contents.is_begun and contents.in_hand is None and contents.member.group_id == self.group.id
        return ours and path == self.path

    @property
    def is_begun(self) -> bool:
        """True if the journal contains a change of a group, applied or still planned."""
        return self._contents.is_begun

    @property
    def says_stores(self) -> bool:
        """True if the journal lists stores at the end of the group."""
        return bool(self._contents.member.stores)

    def before(self) -> dict[Pdo, PdoConfig]:
        """The PDO configurations from before an incomplete group."""
        contents = self._contents
        if not contents.is_begun or contents.member.group_id != self.group.id:
            return {}
        kept = () if self._on_disk is None else self._on_disk[0].changes  # including possible side effects
        changes = (*kept, *contents.plan.changes)
        return {change.pdo: change.before for change in changes if isinstance(change, PdoChange)}

    def also_cover(self, plan: Plan | None) -> None:
        """Add *plan* to the journal: present values that the changes may alter as a side effect."""
        self._may_be_altered = plan

    def prepare(self, plan: Plan, identity: Identity, nmt_state: int | None, *, room: int, group: GroupMember) -> None:
        """Put the journal of the whole *plan* on disk, before the first write to any node of a group.

        Later versions need no more space: *room* is how many bytes to reserve, beside those for the progress of the
        stores of *group*. Raises SafetyRefusal if the journal cannot be kept.
        """
        before, self.identity = self._copy(), identity
        with self._files("kept"):
            self.entry = self._contents.prepare(self.group, plan, nmt_state)
            self._write_or_restore(before, room + JournalFolder.length_of(group.final, (*group.stores, *group.equal)))

    def begin(
        self,
        plan: Plan,
        identity: Identity,
        nmt_state: int | None,
        asked: tuple[str, ...] = (),
        *,
        is_test: bool = False,
        is_remembered: bool = True,
        room: int = 0,
    ) -> None:
        """Write the journal to disk before the first write of *plan* to the device with this *identity*.

        After a kill `recover` then restores the values before *plan*, or before its group. *nmt_state* is the node's
        state now, None if unknown. *asked* are the PDOs that `learn` probes. *is_test*: *plan* only tests a store.
        *is_remembered*: `undo` can revert *plan* later. *room* is the number of bytes to reserve for later versions.
        A plan without these three that only rolls back a part of the group is in the journal already: a full disk does
        not stop it. Raises SafetyRefusal if the journal cannot be written.
        """
        before, self.identity = self._copy(), identity
        covered = not (is_remembered or is_test or asked) and self._contents.is_begun and self._puts_back(plan)
        if covered and self._on_disk is not None and self._on_disk[1] == self._contents.member:
            self._contents.in_hand = plan
            return
        with self._files("kept"):
            self.entry = self._contents.begin(self.group, plan, nmt_state, asked, is_test=is_test)
            try:
                self._write_or_restore(before, room if is_remembered else 0)
            except (OSError, SafetyRefusal):
                if not covered:
                    raise
                self._contents.in_hand = plan  # the journal on disk covers this as well

    def _copy(self) -> ChangesToRollBack:
        return replace(self._contents, made=[*self._contents.made])

    def _write_or_restore(self, before: ChangesToRollBack, room: int) -> None:
        """Write and note the journal; on failure return to *before*, since no device was written."""
        try:
            if self.group.id is not None:
                self.journals.open_group(self.group.id)
            self._write(room)
            self.lock.note(self.path)
        except BaseException:
            self._contents = before
            if not before.is_begun:
                self._on_disk = None
                remove(self.path)
                with suppress(OSError):
                    self.journals.tidy(self.group.id)
            raise

    def _puts_back(self, plan: Plan) -> bool:
        """True if the journal on disk covers all objects of *plan* with the values from before the group."""
        if self._on_disk is None or self._contents.member.group_id != self.group.id:
            return False
        return covers(self._on_disk[0], combine_plans(plan.node_id, [self._contents.plan, plan]))

    def _guarded(self) -> Plan:
        """Everything to roll back, with the values possibly altered as a side effect."""
        plan = self._contents.plan
        return plan if self._may_be_altered is None else combine_plans(plan.node_id, [self._may_be_altered, plan])

    def _write(self, room: int = 0) -> None:
        plan = self._guarded()
        self.journals.write(plan, self.identity, self._contents.nmt_state, self._contents.member, room=room)
        self._on_disk = (plan, self._contents.member)

    def note(self, plan: Plan) -> None:
        """Replace the plan in progress on disk by *plan*: more must be rolled back."""
        with self._files("kept"):
            self._contents.in_hand = plan
            self._write()

    def carried_out(self) -> None:
        """Mark the change in progress as verified."""
        self._contents.carried_out()

    def end(self) -> None:
        """Remove the journal after the change was verified or rolled back, unless a group is open."""
        self._contents.in_hand = None
        self._contents.end_test()
        if self._contents.is_begun:  # what it says of the change in hand is so, also where that was undone
            return
        self.delete()

    def adopt(self, journal: Journal) -> None:
        """Take over *journal* of a group that another process left verified on every node, to complete the group."""
        self.identity = journal.identity
        self._contents = ChangesToRollBack(journal.nmt_state, journal.member, [journal.plan])
        self._on_disk = (journal.plan, journal.member)

    def record_stores(self, line: str, stores: tuple[Storing, ...] = (), equal: tuple[Storing, ...] = ()) -> None:
        """Record the final *line* of the group, which no undo reverts, and its *stores*; empty to cancel.

        *equal* are the nodes that matched already: neither changed nor stored.
        """
        if self._contents.is_begun:
            self._contents.member = self._contents.member._replace(final=line, stores=stores, equal=equal)
            if line:
                with self._files("kept"):
                    self._write()

    def complete_group(self) -> None:
        """Complete the group on every node and remove the journal. Raises JournalKept if removal fails."""
        if self.group.id is not None:
            try:
                self.journals.close_group(self.group.id)
            except OSError as failed:
                raise self._not_removed(failed) from failed
        self.end_group()

    def abandon_group(self) -> None:
        """Leave the group incomplete; changes not rolled back wait for `recover`."""
        self._tidy(self.group.id)

    def _tidy(self, group_id: str | None) -> None:
        with self._files("removed"):
            self.journals.tidy(group_id)

    def end_group(self) -> None:
        """Remove the journal after this node's part of the group was rolled back and verified."""
        if self._contents.is_begun and self._contents.in_hand is None:
            group_id = self._contents.member.group_id
            self.delete()
            self._tidy(group_id)

    def detach(self) -> None:
        """Forget the changes of this process, but leave the files on disk."""
        self._contents, self._on_disk, self._may_be_altered = ChangesToRollBack(), None, None

    def delete(self) -> None:
        """Remove the journal: nothing must be rolled back any more.

        Raises JournalKept if the file remains. A removal that may not survive a power failure, or a note left in the
        lock, only gives a message: `recover` asks before acting.
        """
        self.detach()
        path = self.path
        try:
            remove(path)
        except OSError as failed:
            raise self._not_removed(failed) from failed
        try:
            self.journals.remove(self.lock.node_id)
            self.lock.note(None)
        except OSError as failed:
            self.warn(f"the state folder takes nothing more ({failed.strerror or failed}): {failed.filename or path}")

    def _not_removed(self, failed: OSError) -> JournalKept:
        node_id = self.lock.node_id
        error = JournalKept(
            f"the journal of node {node_id} cannot be removed",
            node=node_id,
            place=str(self.path),
            why=failed.strerror or str(failed),
            hint=f"delete {self.path}: there is nothing to recover, but until then the node cannot be written",
            state="left_changed",
        )
        error.state_text = "as planned: written and verified; a recovery would roll it back"
        return error

    def _files(self, what: str) -> AbstractContextManager[None]:
        return journal_files(self.journals, self.lock.node_id, what)


def complete_groups(journals: Iterable[OwnJournal]) -> None:
    """Complete the group of *journals*: remove each, so that `recover` no longer reverts the changes.

    Raises JournalKept if some cannot be removed, after all others were; the first has the others in its details.
    """
    kept: list[JournalKept] = []
    for journal in journals:
        try:
            journal.complete_group()
        except JournalKept as failed:
            kept.append(failed)
    if kept:
        kept[0].details += [("also", other.text) for other in kept[1:]]
        raise kept[0]


def journal_room(held: Mapping[Pdo, PdoConfig]) -> int:
    """The further bytes a journal may need: for its words, and for the PDOs *held*, should a device alter them."""
    return _ROOM + sum(len(json.dumps(change_document(plan_pdo(pdo, one, one)))) + _MORE for pdo, one in held.items())


@contextmanager
def journal_files(journals: JournalFolder, node_id: int, what: str) -> Iterator[None]:
    """Report a full disk or a read-only folder as an error for the user to fix, not as a bug."""
    try:
        yield
    except OSError as failed:
        place, moved = Path(failed.filename or journals.folder.parent), journals.folder.parent
        moves = place == moved or {journals.folder, moved / "backups"} & {place, *place.parents}
        needed = "dvtcli writes to a real device only with a journal"
        shared = f"make room or mend it; {OTHER_STATE}, with the locks" if OTHER_STATE else "make room or mend it"
        raise SafetyRefusal(
            f"the journal of node {node_id} cannot be {what}: {failed.strerror or failed}",
            node=node_id,
            place=str(place),
            hint=Hint(Action.GIVE_JOURNAL, why=f"takes another folder; {needed}") if moves else f"{shared}; {needed}",
        ) from failed

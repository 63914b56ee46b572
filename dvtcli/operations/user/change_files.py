"""The files about a bus's nodes: locks, backups, journals, history for `undo`.

Only for nodes that outlive this process.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.change.change_group import ChangeGroup
from dvtcli.device.change.change_guard import ChangeGuard
from dvtcli.device.change.change_history import ChangeHistory
from dvtcli.device.change.journal import JournalFolder
from dvtcli.device.change.private_file import unusable
from dvtcli.device.programs import ProgramNotes
from dvtcli.domain.hint import Action, Hint, as_hint, verbatim
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.text import all_nodes, join_some
from dvtcli.errors import InputFileError, SafetyRefusal
from dvtcli.files.user_folders import user_folder
from dvtcli.operations.user.options import Options

if TYPE_CHECKING:
    from dvtcli.device.change.journal import Journal
    from dvtcli.domain.object_dictionary import ObjectDictionary


@dataclass(slots=True)
class ChangeFiles:
    """The files about the nodes of *bus*, by its name; journals and backups in *folder*."""

    bus: str
    folder: Path
    #: the node-ID of -n
    selected: int | None
    #: show a message, and a warning
    report: Callable[[Hint | str], None]
    warn: Callable[[Hint | str], None]
    #: the current work, for another dvtcli that finds a node's lock taken
    doing: Callable[[], str]
    #: the group of the current changes
    group: ChangeGroup = field(default_factory=ChangeGroup)
    #: messages about interrupted changes, for those of several nodes only once
    _said: set[Hint | str] = field(default_factory=set)
    #: nodes with an interrupted change that was not reported when they were met; None: each is reported at once
    withheld: list[ChangeGuard] | None = None

    def guard(self, node_id: int, dictionary: ObjectDictionary | None) -> ChangeGuard:
        """Return lock, backup and journal of a node; reports an interrupted change, or missing files."""
        guard = self._change_guard(node_id, dictionary)
        needed = (guard.lock.folder, guard.journals.folder, self.folder / "backups")
        refused = next(filter(None, map(unusable, needed)), None)
        if refused is not None and refused.text not in self._said:
            self._said.add(refused.text)
            said = as_hint(f"{refused.text}; until that is corrected no node of this bus can be changed")
            self.report(said + refused.hint if refused.hint else said)
        interrupted, is_damaged = _interrupted(guard)
        if interrupted and interrupted not in self._said:
            if self.withheld is not None and not is_damaged:
                self.withheld.append(guard)
            else:
                self._said.add(interrupted)
                (self.warn if is_damaged else self.report)(interrupted)
        if (program := self.programs().unfinished_text(node_id)) and guard.lock.is_free():
            self.warn(program)
        return guard

    def programs(self) -> ProgramNotes:
        """Return the notes of running and unfinished program downloads on this bus."""
        return ProgramNotes(self.folder / "programs", self.bus)

    def interrupted(self, node_id: int, guard: ChangeGuard | None) -> Hint | str:
        """Report an interrupted change of the node; empty if none.

        For a node without *guard*, not met yet, the user is told, too.
        """
        return _interrupted(guard or self.guard(node_id, None))[0]

    def history(self) -> ChangeHistory:
        """Return the remembered changes on this bus."""
        return ChangeHistory(state_folder(None) / "changes", self.bus, self.report)

    @staticmethod
    def is_fixed(dictionary: ObjectDictionary | None) -> Callable[[Pdo], bool]:
        """Return a test for read-only COB-IDs by *dictionary*."""

        def told(pdo: Pdo) -> bool:
            entry = dictionary.entry(pdo.communication_index, 1) if dictionary else None
            return entry is not None and not entry.access.writable

        return told

    def _change_guard(self, node_id: int, dictionary: ObjectDictionary | None) -> ChangeGuard:
        locks = state_folder(None) / "locks"
        fixed = self.is_fixed(dictionary)
        guard = ChangeGuard(
            self.folder, locks, self.bus, node_id, self.report, fixed, self.warn, self.doing, self.group
        )
        guard.history.selected = self.selected
        return guard


def _interrupted(guard: ChangeGuard) -> tuple[Hint | str, bool]:
    """Report an interrupted change, empty if none; and whether its journal is damaged."""
    try:
        journal = guard.interrupted_journal()
    except (InputFileError, SafetyRefusal) as damaged:
        said = as_hint(f"{damaged.text}: {damaged.why or damaged.place}")
        return said + damaged.hint if damaged.hint else said, True
    return "" if journal is None else _how_to_finish(journal), False


def _how_to_finish(journal: Journal) -> Hint:
    changed = _changed(journal)
    labels, node_id = join_some(journal.labels), journal.plan.node_id
    if journal.member.group_id is None and journal.member.asked:
        what = f"the learning of this device, which asked {labels} of node {node_id},"
        return Hint(
            Action.RECOVER, {"node": node_id}, f"{what} was interrupted: {{}} rolls back to the old configuration"
        )
    if journal.member.group_id is None:
        return Hint(
            Action.RECOVER,
            {"node": node_id},
            f"a change of {labels} of node {node_id} was interrupted: {{}} rolls back to the old configuration",
        )
    accepted = [store.node_id for store in journal.member.stores if store.is_accepted]
    but = f" except {join_some(map(str, accepted))}, accepted as found" if accepted else ""
    back = Hint(Action.RECOVER_ALL, why=f", {{}} rolls all its changes back, on all nodes{but}")
    if journal.member.stores and not any(store.waits for store in journal.member.stores):
        said = f"{verbatim(journal.member.name)} was interrupted after nodes had stored its changes, {changed}"
        return Hint(Action.FINISH_STORES, why=f"{said}: {{}} reads every node{but} again") + back
    if journal.member.stores:
        said = f"{verbatim(journal.member.name)} was interrupted while nodes stored its changes, {changed}"
        return Hint(Action.FINISH_STORES, why=f"{said}: {{}} stores on the rest of them") + back
    said = f"{verbatim(journal.member.name)} was interrupted, which changed {changed}"
    return Hint(Action.RECOVER_ALL, why=f"{said}: {{}} rolls all its changes back, on all nodes")


def _changed(journal: Journal) -> str:
    """Describe the change of *journal*: if on several nodes, with all of them."""
    group_id = journal.member.group_id
    together = [] if group_id is None else JournalFolder(journal.path.parent, journal.bus).all_of(group_id)
    ids = sorted({journal.plan.node_id, *(other_journal.plan.node_id for other_journal in together)})
    if len(ids) > 1:
        return all_nodes(ids)
    return f"{join_some(journal.labels)} of node {ids[0]}"


def state_folder(options: Options | None) -> Path:
    """Return the folder of journals and backups: --journal, else the user's state folder (for None)."""
    if options is not None and options.journal:
        return Path(options.journal)
    return user_folder("state")

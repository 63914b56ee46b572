"""Find interrupted changes: of a file, of the selected node, or of the bus if none is selected.

Takes the locks of their nodes: a change in progress is not interrupted.
"""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.change.journal import JournalFolder, read_journal
from dvtcli.device.change.lock import NodeLock
from dvtcli.device.change.private_file import file_name, unreadable
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import InputFileError, NoAnswer, SafetyRefusal, UsageError
from dvtcli.operations.user.change_files import state_folder
from dvtcli.operations.user.options import is_file

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dvtcli.device.change.change_group import GroupMember
    from dvtcli.device.change.journal import Journal
    from dvtcli.errors import DvtcliError
    from dvtcli.operations.session.session import SessionNodes


def newest_store_record(journals: Sequence[Journal]) -> GroupMember:
    """Return the most advanced record of stores: journals are written one by one.

    The store of a node with a journal among them is not accepted: an accept was not completed.
    """
    member = max((journal.member for journal in journals), key=lambda member: (len(member.stores), *_progress(member)))
    open_ids = {journal.plan.node_id for journal in journals}
    stores = tuple(
        store._replace(is_accepted=store.is_accepted and store.node_id not in open_ids) for store in member.stores
    )
    return member._replace(stores=stores)


def _progress(member: GroupMember) -> tuple[int, int, int]:
    """How many nodes were accepted, how many answered their store, and how many were asked."""
    return (
        sum(store.is_accepted for store in member.stores),
        sum(store.is_done or store.is_refused for store in member.stores),
        sum(store.is_begun for store in member.stores),
    )


def waiting(member: GroupMember) -> list[int]:
    """Return node-IDs of *member* whose stores are neither known to be done nor accepted."""
    return [store.node_id for store in member.stores if store.waits]


def stores_of(member: GroupMember) -> dict[str, list[int]]:
    """Group the nodes of *member*: stored, unknown, refused or not asked."""
    done = [store.node_id for store in member.stores if store.is_done]
    asked = [store.node_id for store in member.stores if store.is_begun and store.waits and not store.is_refused]
    if not any(
        store.is_begun for store in member.stores
    ):  # an earlier version, which noted nothing else: they go in turn
        asked = waiting(member)[:1]
    return {
        "stored": done,
        "unknown": asked,
        "not stored": [node_id for node_id in waiting(member) if node_id not in asked],
    }


def stored_before(journal: Journal, journals: Sequence[Journal]) -> bool | None:
    """Tell whether the node of *journal* stored before its process ended; None if unknown.

    *journals* are all waiting journals, including others of the same change.
    """
    ours = (
        [own_journal for own_journal in journals if own_journal.member.group_id == journal.member.group_id]
        if journal.member.group_id
        else [journal]
    )
    member = newest_store_record(ours)
    if not member.stores:
        return None if journal.member.final else False  # a line of a script stores, and may name any node
    states = stores_of(member)
    if journal.plan.node_id in states["stored"]:
        return True
    return None if journal.plan.node_id in states["unknown"] else False


def waiting_paths(session: SessionNodes, file: str | None, refused: list[DvtcliError] | None = None) -> list[Path]:
    """Return the chosen journals, readable or not; empty if no change was interrupted.

    Raises UsageError if *file* is no journal, SafetyRefusal if another dvtcli is changing a node: if several are
    chosen, *refused*, if given, gets the error. Also raises SafetyRefusal if the folders of journals or locks cannot be
    read: interrupted changes are then unknown.
    """
    if file is not None:
        if not is_file(file):
            raise UsageError(
                f"{file}: no such file", place=file, hint=Hint(Action.RECOVER, why="alone uses the node's own journal")
            )
        return _held_file(session, Path(file))
    unread = next(
        filter(None, map(unreadable, (session.state_folder / "journals", state_folder(None) / "locks"))), None
    )
    if unread is not None:
        unread.why = "journals and locks are kept there: it is unknown whether a change was interrupted"
        raise unread
    selected = session.selected_id()
    if selected is not None:
        return _of_node(session, selected)
    found: list[Path] = []
    for node_id in waiting_ids(session):
        try:
            found += _of_node(session, node_id)
        except SafetyRefusal as at_work:
            if refused is None:
                raise
            refused.append(at_work)
    return found


def _of_node(session: SessionNodes, node_id: int) -> list[Path]:
    guard = session.open_network().node(node_id).guard
    if guard is not None:
        path = guard.unfinished_journal() if session.dry_run else guard.lock_and_find_journal()
    else:
        journals = JournalFolder(session.state_folder / "journals", session.wire.name)
        path = journals.path(node_id) if journals.counts(journals.path(node_id)) else None
    return [path] if path is not None else []


def waiting_ids(session: SessionNodes) -> list[int]:
    """Return node-IDs of this bus with a journal: in our folder, or noted in the node's lock."""
    bus = session.open_network().bus.name
    journals, locks = JournalFolder(session.state_folder / "journals", bus), state_folder(None) / "locks"
    names = [*journals.folder.glob(f"{file_name(bus)}-*.json"), *locks.glob(f"{file_name(bus)}-*.lock")]
    numbers = (re.fullmatch(rf"{re.escape(file_name(bus))}-(\d{{1,3}})\.\w+", path.name) for path in names)
    ids = sorted({int(number[1]) for number in numbers if number is not None})
    noted = {node_id: NodeLock(locks, bus, node_id).noted() for node_id in ids}
    return [
        node_id
        for node_id in ids
        if any(journals.counts(path) for path in (journals.path(node_id), noted[node_id]) if path)
    ]


def _held_file(session: SessionNodes, path: Path) -> list[Path]:
    """Return the journal at *path* with its node locked; empty if it is gone by then."""
    network = session.open_network()
    try:
        journal = read_journal(path)
    except InputFileError:  # whoever reads it says so; `recover --discard` sets it aside under the lock
        return [path] if path.exists() else []
    if not session.dry_run and journal.bus == network.bus.name:
        # on another bus, nobody here works on its node
        guard = network.node(journal.plan.node_id).guard
        if guard is not None:
            guard.take_lock()
    return [path] if path.exists() else []


def with_others(session: SessionNodes, path: Path) -> list[Journal]:
    """Return the journal at *path* and others of the same change, with their nodes locked."""
    journal = read_journal(path)
    if journal.member.group_id is None:
        return [journal]
    beside = JournalFolder(path.parent, journal.bus).all_of(journal.member.group_id)
    others = [other_journal for other_journal in beside if other_journal.plan.node_id != journal.plan.node_id]
    return sorted(
        [journal, *(other for other in others if _is_held(session, other))],
        key=lambda waiting_journal: waiting_journal.plan.node_id,
    )


def _is_held(session: SessionNodes, journal: Journal) -> bool:
    """Lock the node; returns whether the journal still exists."""
    if session.dry_run or journal.bus != session.open_network().bus.name:
        return True
    with suppress(NoAnswer):  # it is not there: who puts it back says so
        guard = session.open_network().node(journal.plan.node_id).guard
        if guard is not None:
            guard.take_lock()
    return journal.path.exists()

"""Closing journals without a way back: accepted as the device is now, or set aside. Parses no words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvtcli.device.change.journal import ACCEPTED, DISCARDED, Journals, read_journal
from dvtcli.device.change.own_journal import journal_files
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.several import several
from dvtcli.errors import InputFileError, SafetyRefusal, UsageError
from dvtcli.operations.recover.stores_begun import furthest, stored_before
from dvtcli.operations.recover.waiting_journals import waiting_paths, with_others
from dvtcli.operations.results import Facts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dvtcli.device.change.journal import Journal
    from dvtcli.device.node import Node
    from dvtcli.operations.session.session import Session


def nothing_to_recover(session: Session) -> Facts:
    """The answer where no change was interrupted."""
    node_id = session.selected_id()
    where = "on this bus" if node_id is None else "of this node"
    said = f"nothing to recover: no change {where} was interrupted"
    return Facts("recover", (("node", node_id), ("recovered", False)), (said,))


def refuse_other_bus(session: Session, journal: Journal) -> None:
    """SafetyRefusal where *journal* was made on another bus, unless forced."""
    if journal.bus != session.wire.name and not session.options.force:
        raise SafetyRefusal(
            f"the journal was made on another bus: {journal.bus}, not {session.wire.name}",
            node=journal.plan.node_id,
            place=str(journal.path),
            hint=Hint(Action.FORCE, why="attach to that bus, or {} if it is the same one under another name"),
        )


def _one_path(session: Session, file: str | None, word: str) -> Path | None:
    """The journal that is to be closed, one at a time; None where no change was interrupted."""
    paths = waiting_paths(session, file)
    if len(paths) > 1:
        raise UsageError(
            f"several changes were interrupted on this bus: --{word} closes one at a time",
            hint=Hint(Action.RECOVER, {"node": "ID", word: True}),
        )
    return paths[0] if paths else None


def accepted(session: Session, file: str | None) -> Facts:
    """Close the journal with what the device holds now, which is shown beside what it held; writes nothing to it."""
    from dvtcli.device.change.accepted_state import accepted_states, refuse_other_device
    from dvtcli.device.change.pending import CHANGE

    path = _one_path(session, file, "accept")
    if path is None:
        return nothing_to_recover(session)
    journal = read_journal(path)
    refuse_other_bus(session, journal)
    node = session.node(journal.plan.node_id)
    refuse_other_device(node, journal)
    states = accepted_states(node, journal)
    together = with_others(session, path)
    others = [one.plan.node_id for one in together if one.path != path]
    kept = None
    if not session.dry_run:
        _hand_on_stores(node, journal, together)
        kept = _set_aside(session, path, node.node_id, ACCEPTED)
        node.pending.suspicions.pop(CHANGE, None)
    text = [
        f"{name:<11} {line}" for one in states for name, line in (("holds now", one.held), ("held before", one.before))
    ]
    rows: tuple[tuple[str, Any], ...] = (
        ("node", node.node_id),
        ("recovered", False),
        ("accepted", kept is not None),
        ("kept", None if kept is None else str(kept)),
        ("held", [one.document() for one in states]),
    )
    if kept is None:
        return Facts("recover", rows, (*text, "dry run: the journal stays"))
    said = f"node {node.node_id}: what it holds now is the new state; the journal is kept as {kept}"
    if unknown := [one.label for one in states if not one.is_known]:
        said += f"; what it holds of {several(unknown)} is not known"
    return Facts("recover", rows, (*text, said, *_after_accepting(node, journal, others)))


def _hand_on_stores(node: Node, journal: Journal, together: Sequence[Journal]) -> None:
    """Before *journal* is closed: those *together* with it say all that it says of stores, and `undo` of its change.

    SafetyRefusal if a journal cannot be written.
    """
    part = furthest(together)
    if journal.part.whole is None or not part.stores:
        return
    journals = Journals(journal.path.parent, journal.bus)
    for other in together:
        if other.path != journal.path and other.part.stores != part.stores:
            told = replace(other.part, final=part.final, stores=part.stores, equal=part.equal)
            with journal_files(journals, other.plan.node_id, "kept"):
                journals.write(other.plan, other.identity, other.nmt_state, told)
    if stored_before(journal, together) is not False and node.keeper is not None:
        node.keeper.past.may_be_stored(node.node_id, journal.identity, journal.part.entries)


def _after_accepting(node: Node, journal: Journal, others: list[int]) -> list[Hint]:
    """What is to be done next, where the change was left half-way."""
    lines = [
        Hint(
            Action.STORE,
            {"node": node.node_id},
            "next: a line behind `held before` sets that back when it is typed; {} keeps what is right",
        )
        + Hint(Action.RESET_NODE, {"node": node.node_id}, ", {} brings back what is stored")
    ]
    if journal.nmt_state == NmtState.OPERATIONAL and node.access.state() is NmtState.PRE_OPERATIONAL:
        lines.append(
            Hint(
                Action.START_NODE,
                {"node": node.node_id},
                "it was OPERATIONAL and is PRE-OPERATIONAL now; when it is right: {}",
            )
        )
    if others:
        ids = ", ".join(map(str, others))
        lines.append(
            Hint(
                Action.RECOVER,
                {"node": others[0]},
                f"what {journal.part.name} changed on node {ids} waits, too: {{}} takes it back",
            )
        )
    return lines


def discarded(session: Session, file: str | None) -> Facts:
    """Set the journal aside unless it can be used; a usable one only with `--force`."""
    path = _one_path(session, file, "discard")
    if path is None:
        return nothing_to_recover(session)
    node_id = _useless_for(session, path)
    kept = None if session.dry_run else _set_aside(session, path, node_id, DISCARDED)
    rows = (
        ("node", node_id),
        ("recovered", False),
        ("discarded", kept is not None),
        ("kept", None if kept is None else str(kept)),
    )
    said = Hint(
        Action.SHOW_PDOS, why=f"the journal is kept as {kept}; look at the node with {{}}, and set it as it should be"
    )
    return Facts("recover", rows, (said if kept is not None else "dry run: the journal stays",))


def _useless_for(session: Session, path: Path) -> int:
    """The node whose writing the journal at *path* blocks; SafetyRefusal where the journal could be used."""
    try:
        journal = read_journal(path)
    except InputFileError:
        return _blocked_by(session, path)
    node_id = journal.plan.node_id
    bus = session.open_network().bus.name
    if not session.options.force and journal.bus == bus and journal.identity == session.node(node_id).identity():
        raise SafetyRefusal(
            f"the journal of node {node_id} can be used: it is not set aside",
            node=node_id,
            place=str(path),
            hint=Hint(Action.RECOVER, why="puts the old configuration back")
            + Hint(Action.RECOVER, {"accept": True}, ", {} takes what the device holds")
            + Hint(Action.FORCE, why="sets it aside all the same"),
        )
    selected = session.selected_id()
    return node_id if selected is None else selected


def _blocked_by(session: Session, path: Path) -> int:
    """The node of a journal that cannot be read: the one that is selected, else what the file's name says."""
    number = path.stem.rpartition("-")[2]
    if not (path.suffix == ".json" and number.isdecimal()):
        raise UsageError(
            f"{path} is no journal: it is not set aside",
            place=str(path),
            hint=Hint(Action.RECOVER, {"discard": True}, "takes the node's own journal"),
        )
    if session.selected_id() is None and number.isdecimal() and 1 <= int(number) <= 127:
        return int(number)
    return session.node_id()


def _set_aside(session: Session, path: Path, node_id: int, word: str) -> Path:
    keeper = session.open_network().node(node_id).keeper
    if keeper is None:
        raise UsageError("a node of this process has no journal: attach to the bus that it was made on")
    return keeper.set_aside(path, word)

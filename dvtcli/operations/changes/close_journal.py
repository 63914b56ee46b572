"""Closing journals without a way back: accepted as the device is now, or set aside. Parses no words."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvtcli.device.change.journal import ACCEPTED, DISCARDED, Journals, read_journal
from dvtcli.device.change.own_journal import journal_files
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.text import join_some
from dvtcli.errors import DvtcliError, InputFileError, SafetyRefusal, UsageError
from dvtcli.operations.changes.waiting_journals import newest_store_record, stored_before, waiting_paths, with_others
from dvtcli.operations.results import Facts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dvtcli.device.change.journal import Journal
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.operations.session.session_nodes import SessionNodes


def nothing_to_recover(session: SessionNodes) -> Facts:
    """Report that no change was interrupted."""
    node_id = session.selected_id()
    where = "on this bus" if node_id is None else "of this node"
    said = f"nothing to recover: no change {where} was interrupted"
    return Facts("recover", (("node", node_id), ("recovered", False)), (said,), changed_nothing=True)


def refuse_other_bus(session: SessionNodes, journal: Journal) -> None:
    """Raises SafetyRefusal if *journal* is of another bus, unless forced."""
    if journal.bus != session.wire.name and not session.options.force:
        raise SafetyRefusal(
            f"the journal was made on another bus: {journal.bus}, not {session.wire.name}",
            node=journal.plan.node_id,
            place=str(journal.path),
            hint=Hint(Action.FORCE, why="connect to that bus, or {} if it is the same bus under another name"),
        )


def accepted(session: SessionNodes, file: str | None) -> Facts:
    """Close the journals with the devices' present values, shown beside the old ones; writes nothing.

    Asks first for several nodes. A journal that cannot be closed does not prevent the others: the first error says what
    was done.
    """
    refused: list[DvtcliError] = []
    paths = waiting_paths(session, file, refused)
    if len(paths) == 1 and not refused:
        rows, text = _accepted(session, paths[0])
        return Facts("recover", rows, text, changed_nothing=True)
    if not paths and not refused:
        return nothing_to_recover(session)
    if paths:
        session.consent(_question(paths))
    nodes: list[dict[str, Any]] = []
    texts: list[Hint | str] = []
    for path in paths:
        try:
            rows, text = _accepted(session, path)
        except DvtcliError as failed:
            refused.append(failed)
        else:
            nodes.append(dict(rows))
            texts += text
    if refused:
        raise _first_of(refused, [str(node["node"]) for node in nodes if node["accepted"]])
    rows = (
        ("node", None),
        ("recovered", False),
        ("accepted", not session.dry_run),
        ("kept", None),
        ("held", []),
        ("nodes", nodes),
    )
    return Facts("recover", rows, tuple(texts), changed_nothing=True)


def _question(paths: Sequence[Path]) -> str:
    named = []
    for path in paths:
        try:
            journal = read_journal(path)
        except (InputFileError, SafetyRefusal):
            continue  # it stays, and that is the error
        named.append(f"{join_some(journal.labels)} of node {journal.plan.node_id}")
    return f"{join_some(named)} will keep their present values, and no later roll-back will change that; accept?"


def _first_of(refused: Sequence[DvtcliError], done: Sequence[str]) -> DvtcliError:
    """Return the first *refused* error with the other errors and the nodes *done*."""
    refused[0].details += [("also", other.text) for other in refused[1:]]
    if done:
        refused[0].details.append(("done", f"node {', '.join(done)}: its present values are accepted"))
    return refused[0]


def _accepted(session: SessionNodes, path: Path) -> tuple[tuple[tuple[str, Any], ...], tuple[Hint | str, ...]]:
    """Close the journal at *path* with its device's present values; returns fields and lines of the result."""
    from dvtcli.device.change.recovery import accepted_states, refuse_other_device
    from dvtcli.device.store.pending import CHANGE

    journal = read_journal(path)
    refuse_other_bus(session, journal)
    node = session.node(journal.plan.node_id)
    refuse_other_device(node, journal)
    states = accepted_states(node, journal)
    together = with_others(session, path)
    others = [other_journal.plan.node_id for other_journal in together if other_journal.path != path]
    kept = None
    if not session.dry_run:
        _hand_on_stores(node, journal, together)
        kept = _set_aside(session, path, node.node_id, ACCEPTED)
        node.pending.suspicions.pop(CHANGE, None)
    text = [
        f"{name:<11} {line}"
        for state in states
        for name, line in (("holds now", state.held), ("held before", state.before))
    ]
    rows: tuple[tuple[str, Any], ...] = (
        ("node", node.node_id),
        ("recovered", False),
        ("accepted", kept is not None),
        ("kept", None if kept is None else str(kept)),
        ("held", [state.document() for state in states]),
    )
    if kept is None:
        return rows, (*text, "dry run: the journal stays")
    said = f"node {node.node_id}: its present values are accepted; the journal is kept as {kept}"
    if unknown := [state.label for state in states if not state.is_known]:
        said += f"; its present values of {join_some(unknown)} are unknown"
    return rows, (*text, said, *_after_accepting(node, journal, others))


def _hand_on_stores(node: Node, journal: Journal, together: Sequence[Journal]) -> None:
    """Before *journal* is closed, copy its record of stores, and its change for `undo`, to those *together*.

    They also record that its own store is over: *node* is not stored any more.

    Raises SafetyRefusal if a journal cannot be written.
    """
    part = newest_store_record(together)
    if journal.part.group_id is None or not part.stores:
        return
    journals = Journals(journal.path.parent, journal.bus)
    stores = tuple(
        store._replace(is_accepted=True) if store.node_id == node.node_id else store for store in part.stores
    )
    for other in together:
        if other.path != journal.path and other.part.stores != stores:
            told = other.part._replace(final=part.final, stores=stores, equal=part.equal)
            with journal_files(journals, other.plan.node_id, "kept"):
                journals.write(other.plan, other.identity, other.nmt_state, told)
    if stored_before(journal, together) is not False and node.guard is not None:
        node.guard.history.may_be_stored(node.node_id, journal.identity, journal.part.entries)


def _after_accepting(node: ReadableNode, journal: Journal, others: list[int]) -> list[Hint]:
    """Suggest the next steps if the change was left half-way."""
    lines = [
        Hint(
            Action.STORE,
            {"node": node.node_id},
            "next: enter a line of `held before` to restore that value; {} stores the values",
        )
        + Hint(Action.RESET_NODE, {"node": node.node_id}, ", {} restores the stored values")
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
                f"the change of {verbatim(journal.part.name)} on node {ids} can be rolled back, too: {{}}",
            )
        )
    return lines


def discarded(session: SessionNodes, file: str | None) -> Facts:
    """Set the journal aside if unusable; a usable journal only with `--force`."""
    paths = waiting_paths(session, file)
    if not paths:
        return nothing_to_recover(session)
    if len(paths) > 1:
        raise _one_at_a_time(paths)
    path = paths[0]
    node_id = _useless_for(session, path)
    kept = None if session.dry_run else _set_aside(session, path, node_id, DISCARDED)
    rows = (
        ("node", node_id),
        ("recovered", False),
        ("discarded", kept is not None),
        ("kept", None if kept is None else str(kept)),
    )
    said = Hint(
        Action.SHOW_PDOS,
        why=f"the journal is kept as {verbatim(kept)}; check the node with {{}}, and correct its values",
    )
    text = said if kept is not None else "dry run: the journal stays"
    return Facts("recover", rows, (text,), changed_nothing=True)


def _one_at_a_time(paths: Sequence[Path]) -> UsageError:
    """Make the error for several journals; its hint names those of *paths* that are unusable."""
    damaged = next((path for path in paths if not _is_readable(path)), None)
    if damaged is None:
        hint = Hint(Action.RECOVER_ALL, why="each of them can be used: {} rolls all of them back")
    else:
        hint = Hint(Action.RECOVER, {"node": _number_of(damaged), "discard": True}, f"sets {verbatim(damaged)} aside")
    return UsageError(
        "several changes were interrupted on this bus; choose the one to close",
        given={"discard": True},
        why=f"they are in {join_some(map(str, paths))}",
        hint=hint,
    )


def _is_readable(path: Path) -> bool:
    try:
        read_journal(path)
    except (InputFileError, SafetyRefusal):
        return False
    return True


def _useless_for(session: SessionNodes, path: Path) -> int:
    """Return the node blocked by an unusable journal; raises SafetyRefusal if it is usable."""
    try:
        journal = read_journal(path)
    except InputFileError:
        return _blocked_by(session, path)
    node_id = journal.plan.node_id
    bus = session.open_network().bus.name
    if not session.options.force and journal.bus == bus and journal.identity == session.node(node_id).identity():
        raise SafetyRefusal(
            f"the journal of node {node_id} is usable: it is not set aside",
            node=node_id,
            place=str(path),
            hint=Hint(Action.RECOVER, why="rolls back to the old configuration")
            + Hint(Action.RECOVER, {"accept": True}, ", {} accepts the device's present values")
            + Hint(Action.FORCE, why="sets it aside all the same"),
        )
    selected = session.selected_id()
    return node_id if selected is None else selected


def _number_of(path: Path) -> str:
    """Return the node-ID in the name of a journal at *path*."""
    return path.stem.rpartition("-")[2]


def _blocked_by(session: SessionNodes, path: Path) -> int:
    """Return the node of an unreadable journal: the selected node, else by the file's name."""
    number = _number_of(path)
    if not (path.suffix == ".json" and number.isdecimal()):
        raise UsageError(
            f"{path} is not a journal: it is not set aside",
            place=str(path),
            hint=Hint(Action.RECOVER, {"discard": True}, "uses the node's own journal"),
        )
    if session.selected_id() is None and number.isdecimal() and 1 <= int(number) <= 127:
        return int(number)
    return session.node_id()


def _set_aside(session: SessionNodes, path: Path, node_id: int, word: str) -> Path:
    guard = session.open_network().node(node_id).guard
    if guard is None:
        raise UsageError(
            "a node simulated in this process has no journal: connect to the bus on which the change was made"
        )
    return guard.set_aside(path, word)

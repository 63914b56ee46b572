"""Recover interrupted changes: rolled back or completed, accepted as the device is now, or set aside."""

from __future__ import annotations

import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvtcli.device.change.journal import ACCEPTED, DISCARDED, JournalFolder, read_journal
from dvtcli.device.change.own_journal import journal_files
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.plan import alters
from dvtcli.domain.text import all_nodes, join_some
from dvtcli.errors import DvtcliError, InputFileError, NoAnswer, Restarted, SafetyRefusal, UsageError, worst_of
from dvtcli.operations.changes.change import change_result
from dvtcli.operations.changes.waiting_journals import (
    newest_store_record,
    stored_before,
    stores_of,
    waiting,
    waiting_paths,
    with_others,
)
from dvtcli.operations.results import Changed, ChangedNodes, Facts

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dvtcli.device.change.change_guard import ChangeGuard
    from dvtcli.device.change.journal import Journal
    from dvtcli.device.change.recovery import Recovery
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.operations.session.session import Session, SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


def recover(
    session: Session,
    file: str | None = None,
    *,
    accept: bool = False,
    discard: bool = False,
    finish: bool = False,
) -> Changed | ChangedNodes | Facts:
    """Roll back interrupted changes on all their nodes, and remove the journals.

    *file* is a journal; None: that of the selected node, or all of the bus if none is selected. *accept* keeps the
    devices' present values and writes nothing; *discard* sets an unusable journal aside; *finish* completes the stores
    of a network whose nodes had all been verified. Raises SafetyRefusal for a journal of another bus or device,
    LeftChanged if a device refuses; an error names what was rolled back before it.
    """
    ways = {"accept": accept, "discard": discard, "finish": finish}
    if sum(ways.values()) > 1:
        raise UsageError("they exclude each other", given={name: True for name, wanted in ways.items() if wanted})
    if discard:
        return discard_journal(session, file)
    with _reporting_itself(session):
        return accept_values(session, file) if accept else _roll_back_all(session, file, finish_stores=finish)


@contextmanager
def _reporting_itself(session: SessionNodes) -> Iterator[None]:
    """Report that changes are interrupted only if a node does not answer; otherwise `recover` reports its own."""
    files = session.open_network().change_files
    if files is None:
        yield
        return
    withheld: list[ChangeGuard] = []
    files.withheld = withheld
    try:
        yield
    except DvtcliError as failed:
        is_silent = any(isinstance(one, NoAnswer) for one in (failed, *failed.others))
        for interrupted in dict.fromkeys(files.interrupted(guard.node_id, guard) for guard in withheld):
            if is_silent and interrupted:
                session.reporter.note(interrupted)
        raise
    finally:
        files.withheld = None


def _roll_back_all(session: Session, file: str | None, *, finish_stores: bool) -> Changed | ChangedNodes | Facts:
    refused: list[DvtcliError] = []  # of one node; the others are rolled back all the same
    journals = _usable(session, file, refused)
    if refused and not journals:
        raise _worst_with_others(refused)
    if not journals:
        return nothing_to_recover(session)
    for journal in journals:
        refuse_other_bus(session, journal)
    if finish_stores or _decide_to_finish(session, journals):
        from dvtcli.operations.changes.finish_stores import finish_group_stores

        if refused:
            refused[0].details.append(("stores", "nothing is stored while a journal is unusable"))
            raise _worst_with_others(refused)
        return finish_group_stores(session, journals)
    session.consent(lambda: _question(session, journals), _only(journals))
    for said in dict.fromkeys(
        _group_text(journal, journals) for journal in journals if journal.member.group_id is not None
    ):
        session.reporter.note(said)
    done, failures = _roll_back(session, journals)
    failures += refused
    if not failures and (restarted := _restarted(session, done)) is not None:
        failures = [restarted]
    if failures:
        lost = [recovered.node for recovered in done if _restarted_since(session.node(recovered.node))]
        failed = _worst_with_others(failures)
        failed.beside([recovered.node for recovered in done if recovered.node not in lost], failures, "rolled back")
        failed.nodes |= dict.fromkeys(lost, "unknown")
        raise failed
    return done[0] if len(done) == 1 else ChangedNodes(tuple(done))


def _usable(session: SessionNodes, file: str | None, refused: list[DvtcliError]) -> list[Journal]:
    """The journals that are meant and can be used; *refused* has why others cannot."""
    found: dict[Path, Journal] = {}
    for path in waiting_paths(session, file, refused):
        try:
            found |= {other.path: other for other in with_others(session, path)}
        except (InputFileError, SafetyRefusal) as unusable:
            refused.append(unusable)
    return list(found.values())


def _decide_to_finish(session: SessionUser, journals: list[Journal]) -> bool:
    """Decide whether begun stores are to be completed; raises SafetyRefusal if nobody can answer.

    Does not ask beside other interrupted changes, but reports that each may be completed alone.
    """
    from dvtcli.operations.changes.finish_stores import may_finish

    groups = {
        journal.member.group_id: [other for other in journals if other.member.group_id == journal.member.group_id]
        for journal in journals
    }
    finishing = [ours for ours in groups.values() if may_finish(ours)]
    alone = len(groups) == 1
    for ours in finishing:
        if session.options.yes or session.dry_run or not alone:
            node = {} if alone else {"node": ours[0].plan.node_id}
            back = Hint(Action.RECOVER_ALL, why=f"{verbatim(_begun_stores(ours))}: {{}} rolls back")
            session.reporter.note(back + Hint(Action.FINISH_STORES, node, ", {} would continue"))
        else:
            what = "store on the others?" if waiting(newest_store_record(ours)) else "is it to stay so?"
            return _asked_to_finish(session, _begun_stores(ours), what)
    return False


def _begun_stores(journals: list[Journal]) -> str:
    member = newest_store_record(journals)
    told = "; ".join(f"{label}: {all_nodes(ids)}" for label, ids in stores_of(member).items() if ids)
    when = "while" if waiting(member) else "once"
    return f"every node had the values of {member.name}, but it ended {when} they stored ({told})"


def _asked_to_finish(session: SessionUser, text: str, what: str) -> bool:
    answer = session.reporter.ask(f"{text}; {what} No asks about rolling back")
    if answer is None:
        raise SafetyRefusal(
            f"{session.reporter.unanswered}: {text}",
            hint=Hint(Action.FINISH_STORES, {"yes": True}, "continues")
            + Hint(Action.RECOVER, {"yes": True}, ", {} rolls back"),
        )
    return answer


def _only(journals: list[Journal]) -> int | None:
    """Return the node of *journals*; None if there are several."""
    ids = {journal.plan.node_id for journal in journals}
    return ids.pop() if len(ids) == 1 else None


def _question(session: SessionNodes, journals: Sequence[Journal]) -> str:
    """Ask before a recovery: writes with the nodes' present values, and what is not written."""
    from dvtcli.device.change.recovery import Recovery

    back: list[str] = []
    same: list[str] = []
    unread: list[str] = []
    for journal in journals:
        node_id = journal.plan.node_id
        try:
            plan = Recovery.begin(session.node(node_id), journal).plan
        except DvtcliError as failed:
            unread.append(f"{join_some(journal.labels)} of node {node_id} cannot be read now ({failed.text})")
            continue
        written = list(dict.fromkeys(change.label for change in plan.changes if alters(change)))
        changed = [change.label for change in journal.plan.changes if alters(change)]
        others = [label for label in dict.fromkeys(journal.member.asked or changed) if label not in written]
        back += [f"{join_some(written)} of node {node_id}"] if written else []
        same += [f"{join_some(others)} of node {node_id}"] if others else []
    is_learning = all(journal.member.asked for journal in journals)
    what = "the interrupted learning" if is_learning else "the interrupted change"
    said = [f"{join_some(back)} will be rolled back to the state before {what}"] if back else []
    said += [f"already as before {what}, compared only: {join_some(same)}"] if same else []
    return f"{'; '.join([*said, *unread])}; recover?"


def _group_text(journal: Journal, journals: list[Journal]) -> str:
    group_id = journal.member.group_id
    ids = [other.plan.node_id for other in journals if other.member.group_id == group_id]
    return f"{journal.member.name} was interrupted: all its changes are to be rolled back, on {all_nodes(ids)}"


def _worst_with_others(failures: Sequence[DvtcliError]) -> DvtcliError:
    """Return the worst of *failures*, with the others."""
    worst = worst_of(failures)
    worst.details += [("also", other.text) for other in failures if other is not worst]
    return worst


def _roll_back(session: SessionNodes, journals: list[Journal]) -> tuple[list[Changed], list[DvtcliError]]:
    """Roll back, and return the results and the errors; an error does not stop other roll-backs."""
    from dvtcli.device.change.recovery import Recovery, recover_together

    started = time.monotonic()
    begun: list[Recovery] = []
    done: list[Changed] = []
    failures: list[DvtcliError] = []
    for journal in journals:
        try:
            begun.append(Recovery.begin(session.node(journal.plan.node_id), journal))
        except DvtcliError as error:
            failures.append(error)
    failed = recover_together(begun)
    failures += failed.values()
    for recovery in begun:
        try:
            if recovery.node.node_id not in failed:
                ended = _close_and_report(
                    session, recovery, stored_before(recovery.journal, journals), time.monotonic() - started
                )
                left = recovery.left_unknown()
                if left is None:
                    done.append(ended)
                else:
                    failures.append(left)
        except DvtcliError as error:
            failures.append(error)
    return done, failures


def _restarted(session: SessionNodes, done: list[Changed]) -> Restarted | None:
    """Make the error if a node restarted after its recovery, while another was recovered."""
    nodes = [session.node(recovered.node) for recovered in done]
    again = [node.node_id for node in nodes if _restarted_since(node)]
    if not again:
        return None
    return Restarted(
        f"{all_nodes(again)} restarted after the roll-back: unstored values are lost",
        hint=Hint(Action.SHOW_PDOS, why="check its supply, then its values with {}")
        + Hint(Action.UNDO, {"backup": True}, "puts an automatic backup back"),
        state="unknown",
    )


def _restarted_since(node: Node) -> bool:
    """Tell whether *node* sent a boot-up message since its recovery."""
    return node.bus.boot_ups(node.node_id) != node.pending.boot_ups


def _close_and_report(session: SessionNodes, recovery: Recovery, stored: bool | None, seconds: float) -> Changed:
    """Remove the journal after a recovery, and return the result; *stored* as of `stored_before`."""
    from dvtcli.device.change.applied import Applied
    from dvtcli.device.change.undo_plan import unknown_before, unrestored_objects

    node, journal = session.node(recovery.node.node_id), recovery.journal
    plan, not_put_back = recovery.end(stored=stored is not False)
    if stored is not False:
        said = "stored" if stored else "may have stored"
        begun = (
            f"{verbatim(journal.member.final)} had started: node {node.node_id} {said} the values that were rolled back"
        )
        session.reporter.warning(
            Hint(Action.STORE, {"node": node.node_id}, f"{begun}; {{}} accepts its present values")
        )
    unknown = unknown_before([journal.plan])
    findings = (*recovery.restart_findings(), *unknown)
    applied = Applied(plan, findings, not_put_back, unrestored=unrestored_objects(unknown))
    return change_result(session, node, applied, seconds, undone=True)


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


def accept_values(session: SessionNodes, file: str | None) -> Facts:
    """Close the journals with the devices' present values, shown beside the old ones; writes nothing.

    Asks first for several nodes. A journal that cannot be closed does not prevent the others: the first error says what
    was done.
    """
    refused: list[DvtcliError] = []
    paths = waiting_paths(session, file, refused)
    if len(paths) == 1 and not refused:
        rows, text = _accept_values_of(session, paths[0])
        return Facts("recover", rows, text, changed_nothing=True)
    if not paths and not refused:
        return nothing_to_recover(session)
    if paths:
        session.consent(_question_to_close(paths))
    nodes: list[dict[str, Any]] = []
    texts: list[Hint | str] = []
    for path in paths:
        try:
            rows, text = _accept_values_of(session, path)
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


def _question_to_close(paths: Sequence[Path]) -> str:
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
        refused[0].details.append(("done", f"{all_nodes(done)}: the present values are accepted"))
    return refused[0]


def _accept_values_of(session: SessionNodes, path: Path) -> tuple[tuple[tuple[str, Any], ...], tuple[Hint | str, ...]]:
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
    member = newest_store_record(together)
    if journal.member.group_id is None or not member.stores:
        return
    journals = JournalFolder(journal.path.parent, journal.bus)
    stores = tuple(
        store._replace(is_accepted=True) if store.node_id == node.node_id else store for store in member.stores
    )
    for other in together:
        if other.path != journal.path and other.member.stores != stores:
            told = other.member._replace(final=member.final, stores=stores, equal=member.equal)
            with journal_files(journals, other.plan.node_id, "kept"):
                journals.write(other.plan, other.identity, other.nmt_state, told)
    if stored_before(journal, together) is not False and node.guard is not None:
        node.guard.history.may_be_stored(node.node_id, journal.identity, journal.member.entries)


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
        lines.append(
            Hint(
                Action.RECOVER,
                {"node": others[0]},
                f"the change of {verbatim(journal.member.name)} on {all_nodes(others)} can be rolled back, too: {{}}",
            )
        )
    return lines


def discard_journal(session: SessionNodes, file: str | None) -> Facts:
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

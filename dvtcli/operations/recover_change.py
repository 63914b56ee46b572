"""Finishing interrupted changes: put back, accepted as they are, or their journals set aside. Parses no words."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvtcli.device.change.journal import ACCEPTED, DISCARDED, read_journal
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.several import several
from dvtcli.errors import DvtcliError, InputFileError, Restarted, SafetyRefusal, UsageError
from dvtcli.operations.change import changed
from dvtcli.operations.results import Changed, ChangedNodes, Facts
from dvtcli.operations.stores_begun import furthest, stored_before, stores_of
from dvtcli.operations.waiting_journals import waiting_paths, with_others

if TYPE_CHECKING:
    from dvtcli.device.change.finish_interrupted import Recovery
    from dvtcli.device.change.journal import Journal
    from dvtcli.device.node import Node
    from dvtcli.operations.session import Session


def recover(
    session: Session,
    file: str | None = None,
    *,
    accept: bool = False,
    discard: bool = False,
    finish: bool = False,
) -> Changed | ChangedNodes | Facts:
    """Put back what interrupted changes replaced, of all nodes that belong to them, and forget their journals.

    *file* is a journal; None stands for that of the selected node, or where none is selected for all of the bus.
    *accept* takes what the device holds as the new state and writes nothing; *discard* sets a journal that cannot be
    used aside; *finish* goes on with the stores of a network whose nodes had all been verified. SafetyRefusal for a
    journal of another bus or device, LeftChanged where a device does not take it; an
    error says what was put back before it.
    """
    if accept + discard + finish > 1:
        raise UsageError("--accept, --discard and --finish exclude each other")
    if accept:
        return _accepted(session, file)
    return _discarded(session, file) if discard else _recovered(session, file, finish=finish)


def _recovered(session: Session, file: str | None, *, finish: bool) -> Changed | ChangedNodes | Facts:
    found: dict[Path, Journal] = {}
    for path in waiting_paths(session, file):
        found |= {one.path: one for one in with_others(session, path)}
    if not found:
        return _nothing(session)
    journals = list(found.values())
    for journal in journals:
        _refuse_other_bus(session, journal)
    if finish or _rather_finishes(session, journals):
        from dvtcli.operations.finish_stores import finish as go_on

        return go_on(session, journals)
    text = several(f"{_labels(journal)} of node {journal.plan.node_id}" for journal in journals)
    what = "`learn`, which was interrupted" if all(one.part.asked for one in journals) else "the interrupted change"
    session.consent(f"{text} will be put back as before {what}; recover?", _only(journals))
    for said in dict.fromkeys(_whole_text(journal, journals) for journal in journals if journal.part.whole is not None):
        session.tell.note(said)
    done, failed = _put_back(session, journals)
    if failed is not None:
        ids = [str(one.node) for one in done if not _restarted_since(session.node(one.node))]
        if ids:
            failed.details.append(("done", f"node {', '.join(ids)}: put back"))
        raise failed
    return done[0] if len(done) == 1 else ChangedNodes(tuple(done))


def _rather_finishes(session: Session, journals: list[Journal]) -> bool:
    """Whether the stores are to be gone on with, where they had begun; SafetyRefusal where nobody can say so.

    Beside other interrupted changes nobody is asked: that each of them may be finished by itself is said.
    """
    from dvtcli.operations.finish_stores import may_finish

    wholes = {one.part.whole: [other for other in journals if other.part.whole == one.part.whole] for one in journals}
    finishing = [ours for ours in wholes.values() if may_finish(ours)]
    alone = len(wholes) == 1
    for ours in finishing:
        if session.options.yes or session.dry_run or not alone:
            which = "" if alone else f"-n {ours[0].plan.node_id} "
            session.tell.note(f"{_begun_stores(ours)}: recover goes back, {which}recover --finish would go on")
        else:
            return _asked_to_finish(session, _begun_stores(ours))
    return False


def _begun_stores(journals: list[Journal]) -> str:
    part = furthest(journals)
    told = "; ".join(f"{label}: node {', '.join(map(str, ids))}" for label, ids in stores_of(part).items() if ids)
    return f"every node held what {part.name} wanted, and it ended while they stored ({told})"


def _asked_to_finish(session: Session, text: str) -> bool:
    answer = session.tell.ask(f"{text}; store on the others? No goes on to the way back")
    if answer is None:
        raise SafetyRefusal(f"nobody can answer: {text}", hint="recover --finish goes on, recover --yes goes back")
    return answer


def _only(journals: list[Journal]) -> int | None:
    """The one node that *journals* are about; None where there are several."""
    ids = {journal.plan.node_id for journal in journals}
    return ids.pop() if len(ids) == 1 else None


def _nothing(session: Session) -> Facts:
    node_id = session.selected_id()
    where = "on this bus" if node_id is None else "of this node"
    said = f"nothing to recover: no change {where} was interrupted"
    return Facts("recover", (("node", node_id), ("recovered", False)), (said,))


def _labels(journal: Journal) -> str:
    return several(journal.labels)


def _whole_text(journal: Journal, journals: list[Journal]) -> str:
    ids = [one.plan.node_id for one in journals if one.part.whole == journal.part.whole]
    return f"{journal.part.name} was interrupted: every line of it is taken back, on node {', '.join(map(str, ids))}"


def _put_back(session: Session, journals: list[Journal]) -> tuple[list[Changed], DvtcliError | None]:
    """What was put back, and the first error; the other nodes are put back all the same."""
    from dvtcli.device.change.finish_interrupted import Recovery, recover_together

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
    for one in begun:
        try:
            if one.node.node_id not in failed:
                done.append(_ended(session, one, stored_before(one.journal, journals), time.monotonic() - started))
        except DvtcliError as error:
            failures.append(error)
    if failures:
        failures[0].details += [("also", other.text) for other in failures[1:]]
        return done, failures[0]
    return done, _restarted(session, done)


def _restarted(session: Session, done: list[Changed]) -> Restarted | None:
    """The error where a node restarted after it was put back, while another one was."""
    nodes = [session.node(one.node) for one in done]
    again = [node.node_id for node in nodes if _restarted_since(node)]
    if not again:
        return None
    return Restarted(
        f"node {', '.join(map(str, again))} restarted after it was put back: what it had not stored is lost",
        hint="look at its supply, then at what it holds with `pdo`; `undo --backup` puts an automatic backup back",
        state="unknown",
    )


def _restarted_since(node: Node) -> bool:
    """Whether *node* sent a boot-up since it was put back."""
    return node.bus.boot_ups(node.node_id) != node.pending.boot_ups


def _ended(session: Session, recovery: Recovery, stored: bool | None, seconds: float) -> Changed:
    """Forget the journal of what was put back, and answer what was done; *stored* as `stored_before` says it."""
    from dvtcli.device.applied import Applied
    from dvtcli.device.change.way_back import unknown_before

    node, journal = session.node(recovery.node.node_id), recovery.journal
    plan, not_put_back = recovery.end(stored=stored is not False)
    if stored is not False:
        said = "stored" if stored else "may have stored"
        session.tell.warning(
            f"{journal.part.final} had begun: node {node.node_id} {said} what was taken back; "
            f"-n {node.node_id} store keeps what it holds now"
        )
    applied = Applied(plan, unknown_before([journal.plan]), not_put_back)
    return changed(session, node, applied, seconds, undone=True)


def _refuse_other_bus(session: Session, journal: Journal) -> None:
    if journal.bus != session.wire.name and not session.options.force:
        raise SafetyRefusal(
            f"the journal was made on another bus: {journal.bus}, not {session.wire.name}",
            node=journal.plan.node_id,
            place=str(journal.path),
            hint="attach to that bus, or --force if it is the same one under another name",
        )


def _one_path(session: Session, file: str | None, word: str) -> Path | None:
    """The journal that is to be closed, one at a time; None where no change was interrupted."""
    paths = waiting_paths(session, file)
    if len(paths) > 1:
        raise UsageError(
            f"several changes were interrupted on this bus: --{word} closes one at a time",
            hint=f"-n ID recover --{word}",
        )
    return paths[0] if paths else None


def _accepted(session: Session, file: str | None) -> Facts:
    """Close the journal with what the device holds now, which is shown beside what it held; writes nothing to it."""
    from dvtcli.device.change.finish_interrupted import accepted_states, refuse_other_device
    from dvtcli.device.change.pending import CHANGE

    path = _one_path(session, file, "accept")
    if path is None:
        return _nothing(session)
    journal = read_journal(path)
    _refuse_other_bus(session, journal)
    node = session.node(journal.plan.node_id)
    refuse_other_device(node, journal)
    states = accepted_states(node, journal)
    others = [one.plan.node_id for one in with_others(session, path) if one.path != path]
    kept = None if session.dry_run else _set_aside(session, path, node.node_id, ACCEPTED)
    if kept is not None:
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
    return Facts("recover", rows, (*text, said, *_after_accepting(node, journal, others)))


def _after_accepting(node: Node, journal: Journal, others: list[int]) -> list[str]:
    """What is to be done next, where the change was left half-way."""
    lines = [
        "next: a line behind `held before` sets that back when it is typed; `store` keeps what is right, "
        f"`nmt reset-node {node.node_id}` brings back what is stored"
    ]
    if journal.nmt_state == NmtState.OPERATIONAL and node.access.state() is NmtState.PRE_OPERATIONAL:
        lines.append(f"it was OPERATIONAL and is PRE-OPERATIONAL now; when it is right: nmt start {node.node_id}")
    if others:
        ids = ", ".join(map(str, others))
        lines.append(f"what {journal.part.name} changed on node {ids} waits, too: -n {others[0]} recover takes it back")
    return lines


def _discarded(session: Session, file: str | None) -> Facts:
    """Set the journal aside unless it can be used; a usable one only with `--force`."""
    path = _one_path(session, file, "discard")
    if path is None:
        return _nothing(session)
    node_id = _useless_for(session, path)
    kept = None if session.dry_run else _set_aside(session, path, node_id, DISCARDED)
    rows = (
        ("node", node_id),
        ("recovered", False),
        ("discarded", kept is not None),
        ("kept", None if kept is None else str(kept)),
    )
    said = f"the journal is kept as {kept}; look at the node with `pdo`, and set it as it should be"
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
            hint="recover puts the old configuration back, recover --accept takes what the device holds; "
            "--force sets it aside all the same",
        )
    selected = session.selected_id()
    return node_id if selected is None else selected


def _blocked_by(session: Session, path: Path) -> int:
    """The node of a journal that cannot be read: the one that is selected, else what the file's name says."""
    number = path.stem.rpartition("-")[2]
    if session.selected_id() is None and number.isdecimal() and 1 <= int(number) <= 127:
        return int(number)
    return session.node_id()


def _set_aside(session: Session, path: Path, node_id: int, word: str) -> Path:
    keeper = session.open_network().node(node_id).keeper
    if keeper is None:
        raise UsageError("a node of this process has no journal: attach to the bus that it was made on")
    return keeper.set_aside(path, word)

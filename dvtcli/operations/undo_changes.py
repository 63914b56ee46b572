"""Putting changes back: of this session, of earlier processes as they are remembered, or by an automatic backup.

Parses no words. What a device must hold so that a change may be put back is decided in `device.change.way_back`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from dvtcli.device.backups import backups, remarks, way_to
from dvtcli.device.wish import Wish
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan
from dvtcli.domain.rules.finding import Finding, warning
from dvtcli.domain.rules.rule import WARNING, Rule
from dvtcli.domain.script_line import backup_of, change_lines
from dvtcli.errors import DvtcliError, NoAnswer, Restarted, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.change import changed
from dvtcli.operations.results import Changed, ChangedNodes

if TYPE_CHECKING:
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.change.safekeeping import Keeper
    from dvtcli.device.node import Node
    from dvtcli.device.past import Recorded
    from dvtcli.operations.rehearse import Rehearse
    from dvtcli.operations.session import Session

RULES = (Rule("newer-change", WARNING, "`undo` of one node: another one of the bus was changed later", "ours"),)

T = TypeVar("T")


def undo(session: Session, *, everything: bool = False) -> Changed | ChangedNodes:
    """Put back the last change of this session, or with *everything* all of them, on every node.

    Where it changed nothing, or has undone it all, those of earlier processes: of the selected node and what was
    changed from there, or of every node of the bus where none is selected. SafetyRefusal where a device holds something
    else than what was left; an error says which nodes were put back before it.
    """
    order = session.network.order
    if not order:
        return _remembered_put_back(session, everything=everything)
    if not everything:
        return _own_put_back(session, order[-1], everything=False)
    node_ids = list(dict.fromkeys(reversed(order)))
    return _one_by_one(session, node_ids, lambda node_id: _own_put_back(session, node_id, everything=True))


def _one_by_one(session: Session, things: Iterable[T], put_back: Callable[[T], Changed]) -> Changed | ChangedNodes:
    """Put one after the other back; an error says which nodes were before it.

    Restarted where one of them restarted while another was put back.
    """
    done: list[Changed] = []
    again: list[int] = []
    boot_ups: dict[int, int] = {}
    try:
        for thing in things:
            done.append(one := put_back(thing))
            boot_ups[one.node] = session.bus.boot_ups(one.node)
        again += [node_id for node_id, seen in boot_ups.items() if session.bus.boot_ups(node_id) != seen]
        if again:
            raise Restarted(
                f"node {', '.join(map(str, again))} restarted after it was put back: what it had not stored is lost",
                hint="look at its supply, then at what it holds with `pdo`",
                state="unknown",
            )
    except DvtcliError as error:
        ids = [str(one.node) for one in done if one.node not in again]
        if ids:
            error.details.append(("done", f"node {', '.join(ids)}: put back before this"))
        raise
    return done[0] if len(done) == 1 else ChangedNodes(tuple(done))


def _own_put_back(session: Session, node_id: int, *, everything: bool) -> Changed:
    started, node = time.monotonic(), session.node(node_id)
    before = node.history[:]
    applied = node.undo(everything=everything, force=session.options.force)
    undone = before[len(node.history) :]
    as_before = not (applied.findings or applied.not_put_back)
    forgotten = not session.dry_run and as_before and _forgotten(session, node.node_id, undone)
    seconds = time.monotonic() - started
    return changed(session, node, applied, seconds, undone=True, lines=[] if forgotten else None)


def _forgotten(session: Session, node_id: int, undone: list[Plan]) -> bool:
    """Leave *undone* out of what `save` writes, where nothing came after it; whether that was so.

    What was stored, or commanded by NMT, in between belongs to what was done: then the undo is a change of its own.
    """
    kept = list(session.record.lines)
    for plan in reversed(undone):
        if not session.record.take_back(node_id, change_lines(plan)):
            session.record.lines[:] = kept
            return False
    return True


@dataclass(frozen=True, slots=True)
class _Chain:
    """What is remembered of a device that is there, oldest first; its node's lock is held."""

    node: Node
    keeper: Keeper
    entries: list[Recorded]


def _remembered_put_back(session: Session, *, everything: bool) -> Changed | ChangedNodes:
    """Put back what earlier processes changed: the last change of all, or *everything*, one node after the other."""
    selected = session.selected_id()
    chains = _chains(session, selected, only_newest=not everything)
    if not chains:
        raise _nothing(session, selected)
    newer = () if selected is None else _newer_elsewhere(chains)
    return _one_by_one(session, chains, lambda chain: _chain_put_back(session, chain, newer, everything=everything))


def _chains(session: Session, selected: int | None, *, only_newest: bool) -> list[_Chain]:
    """What is meant, the device that was changed last first."""
    keeping = session.open_network().keeping
    if keeping is None:
        return []
    found: list[_Chain] = []
    ids = dict.fromkeys(entry.plan.node_id for entry in keeping.past().tops(selected))
    for node_id in [*ids, *([] if selected is None or selected in ids else [selected])]:
        chain = _chain(session, node_id, selected)
        if chain is not None:
            found.append(chain)
            if only_newest:
                break
    return found


def _chain(session: Session, node_id: int, selected: int | None) -> _Chain | None:
    """What is remembered of the device at *node_id* as far as it is meant; None where that is nothing."""
    keeper = session.open_network().node(node_id).keeper
    assert keeper is not None  # noqa: S101 - its changes are kept
    node = session.node(node_id)
    node.claim()
    identity = node.identity()
    entries = keeper.past.entries(node_id, identity, selected)
    if not entries and node_id == selected:
        entries = _moved(session, keeper, identity)
    return _Chain(node, keeper, entries) if entries else None


def _moved(session: Session, keeper: Keeper, identity: Identity) -> list[Recorded]:
    """The changes of the device under another node-ID, unless a device of this *identity* still answers there."""
    entry = keeper.past.moved(keeper.node_id, identity)
    if entry is None:
        return []
    was = entry.plan.node_id
    try:
        there = session.open_network().node(was).identity()
    except (NoAnswer, SdoAborted, SdoProtocolError):
        there = {}
    # two devices may well have one serial number
    return [] if there == identity else keeper.past.entries(was, identity, None)


def _newer_elsewhere(chains: list[_Chain]) -> tuple[Finding, ...]:
    """A warning where another node of the bus was changed after those that are meant."""
    last = chains[0].keeper.past.newest_of_all()
    if last is None or last.when <= max(chain.entries[-1].when for chain in chains):
        return ()
    text = f"node {last.plan.node_id} was changed later, at {_time(last)}: -n {last.plan.node_id} undo puts that back"
    return (warning("newer-change", f"node {last.plan.node_id}", text),)


def _chain_put_back(session: Session, chain: _Chain, findings: tuple[Finding, ...], *, everything: bool) -> Changed:
    started, node = time.monotonic(), chain.node
    plans = [replace(one.plan, node_id=node.node_id) for one in chain.entries]
    applied, count = node.put_back(plans, everything=everything, force=session.options.force)
    undone = chain.entries[-count:]
    session.tell.note(_undone_text(undone, gone=count > 1 and not len(applied.plan)))
    if not session.dry_run:
        chain.keeper.past.forget(undone)
    applied = replace(applied, findings=(*applied.findings, *findings))
    return changed(session, node, applied, time.monotonic() - started, undone=True)


def _undone_text(undone: list[Recorded], *, gone: bool) -> str:
    since = _time(undone[0])
    if gone:
        return f"what was before the last {len(undone)} changes, since {since}, is there already, as after a reset"
    return (
        f"this puts the change of {since} back"
        if len(undone) == 1
        else (f"this puts the {len(undone)} changes since {since} back")
    )


def _time(entry: Recorded) -> str:
    return f"{entry.when[:19].replace('T', ' ')} UTC"


def _nothing(session: Session, selected: int | None) -> UsageError:
    keeping = session.open_network().keeping
    if keeping is None:
        return UsageError("nothing to undo: this session changed nothing on the node", node=session.node_id())
    if selected is None:
        return UsageError("nothing to undo: no change on this bus is remembered")
    error = UsageError(f"nothing to undo: no change of node {selected} is remembered", node=selected)
    last = keeping.past().newest_of_all()
    if last is not None:
        error.hint = f"the last change on this bus was one of node {last.plan.node_id}: -n {last.plan.node_id} undo"
    return error


def _keeper(session: Session) -> Keeper:
    """What keeps the selected node's files; where none is selected, of the node that was changed last on this bus."""
    network = session.open_network()
    node_id = session.selected_id()
    if node_id is None and network.keeping is not None:
        entry = network.keeping.past().newest_of_all()
        if entry is None:
            raise _nothing(session, None)
        node_id = entry.plan.node_id
    keeper = network.node(session.node_id() if node_id is None else node_id).keeper
    if keeper is None:
        raise UsageError(
            f"no backup of node {node_id or session.node_id()}: it is simulated in this process, which makes none",
            node=node_id or session.node_id(),
            hint="`undo` puts the last change back, `undo --all` all that this session changed",
        )
    return keeper


def undo_to_backup(session: Session, rehearse: Rehearse, when: str | None = None) -> Changed:
    """Make the node's PDOs what an automatic backup says, in one transaction: the newest, or one made at *when*.

    *rehearse* finds what the backup, which is a script, wishes. UsageError, with those there are, where none fits.
    """
    keeper = _keeper(session)
    node = session.node(keeper.node_id)
    found = node.claim()
    file = _backup_file(keeper, node, when)
    session.tell.note(f"this puts {file} back")
    said = remarks(Path(file))
    for remark in said:
        session.tell.warning(f"not put back as it was: {remark}")
    started = time.monotonic()
    wish = rehearse(file, node.node_id).get(node.node_id, Wish())
    if not wish.pdos:
        raise UsageError(
            f"the backup says nothing of a PDO of node {node.node_id}",
            node=node.node_id,
            place=file,
            hint="undo --backup WHEN takes an earlier one",
        )
    changes = way_to({pdo: node.pdo(pdo) for pdo in wish.pdos}, wish.pdos)
    applied = node.apply(Plan(node.node_id, changes), force=session.options.force, found=found)
    applied = replace(applied, not_put_back=tuple(_unlike_backup(node, said)))
    return changed(session, node, applied, time.monotonic() - started, undone=True)


def _unlike_backup(node: Node, said: Iterable[str]) -> Iterator[Finding]:
    """What of those PDOs that a backup cannot put back (*said* are its remarks) is not so already."""
    for remark in said:
        pdo = Pdo.parse(remark.split()[0])
        if f"# {remark}" not in backup_of(pdo, node.pdo(pdo)):
            text = f"{pdo.label} is not put back as it was: {remark}"
            yield warning("way-back", f"0x{pdo.communication_index:04X}:01", text)


def _backup_file(keeper: Keeper, node: Node, when: str | None) -> str:
    """The newest backup of the node, or the newest of those made at *when*; UsageError lists what there is."""
    found = backups(keeper.folder / "backups", keeper.bus, node.node_id, node.identity())
    fitting = found if when is None else [one for one in found if one.was_made(when)]
    if fitting:
        return str(fitting[-1].path)
    text = f"no backup of node {node.node_id} was made at {when}" if found else f"no backup of node {node.node_id}"
    error = UsageError(text, node=node.node_id, hint="a backup is made before dvtcli's first change of a device")
    error.details += [("backup", f"{one.stamp}  {one.path}") for one in found]
    raise error

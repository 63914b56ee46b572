"""Store on the nodes of a verified network change; from the first store on there is no roll-back."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from dvtcli.bus.turns import one_by_one
from dvtcli.device.change.change_group import Storing
from dvtcli.device.change.own_journal import complete_groups
from dvtcli.errors import DeviceRefused, DvtcliError, JournalKept, LeftChanged, SafetyRefusal
from dvtcli.operations.changes.possible_stores import store_group
from dvtcli.operations.changes.store_restore import end_stamp, store_settings
from dvtcli.operations.changes.unfinished_stores import (
    Stores,
    hint_without_journal,
    lost_besides,
    lost_settings,
    not_all_stored,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dvtcli.device.change.own_journal import OwnJournal
    from dvtcli.operations.changes.final_verify import ExpectedAtStore
    from dvtcli.operations.changes.network_transaction import NetworkTransaction
    from dvtcli.operations.results import Stored
    from dvtcli.operations.session.session_nodes import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


def store_network(
    session: SessionNodes,
    transaction: NetworkTransaction,
    stores: tuple[Storing, ...],
    claims: ExpectedAtStore,
    prove: str | None,
    equal: tuple[Storing, ...] = (),
) -> tuple[Stored, ...]:
    """Carry out *stores* node by node; LeftChanged names the nodes that have stored and those that have not.

    *equal* are nodes that were as wanted and neither change nor store: the journals name them.

    Each node is verified against its *claims* right before its store, and all nodes again after the last store. From
    the first store on the journals record the stores; they stay if some stores are missing: `recover` completes or
    rolls back.
    """
    if not stores:
        return ()
    on_way = Stores({storing.node_id: storing for storing in stores}, equal)
    try:
        return store_each(session, transaction.name, on_way, claims, transaction.journals(), prove)
    except BaseException as fault:
        if isinstance(fault, LeftChanged) and not (on_way.lost or on_way.failed):
            try:
                complete_groups(transaction.journals())  # all have stored: nothing must be rolled back
            except JournalKept as kept:
                fault.details.append(("also", f"{kept.text}: {kept.why}"))
        elif isinstance(fault, LeftChanged) and not transaction.journals():
            done = [state.node_id for state in on_way.states.values() if state.is_done]
            cause = on_way.lost[0] if on_way.lost else next(iter(on_way.failed.values()), fault)
            fault.hint = hint_without_journal(cause, done)
        for journal in transaction.journals():
            journal.detach()
        raise


def _end_stamps(session: SessionUser, stores: Stores, claims: ExpectedAtStore) -> tuple[list[int], list[str]]:
    """End the stamps of nodes that could not store: `--trust-stamp` would trust them otherwise.

    Returns the nodes with an ended stamp, and the errors of others.
    """
    ended, failures = list[int](), list[str]()
    for state in stores.states.values():
        if not state.waits:
            continue
        try:
            if end_stamp(session, claims.nodes[state.node_id], "a node that does not store has no stamp"):
                ended.append(state.node_id)
        except DvtcliError as failed:
            failures.append(f"0x1020 of node {state.node_id} may mark it as stored: {failed.text}")
    return ended, failures


def store_each(
    session: SessionNodes,
    name: str,
    stores: Stores,
    claims: ExpectedAtStore,
    journals: Sequence[OwnJournal],
    prove: str | None = None,
) -> tuple[Stored, ...]:
    """Carry out the missing *stores* of the change *name*; *journals* record the progress.

    Each node is verified against its *claims* right before its store, and all again after the last store. A refusal
    does not prevent other stores. LeftChanged names stored and missing nodes; *stores* says whether a node lost values.
    """
    states = list(stores.states.values())

    def store(one: Storing) -> None:
        try:
            _store_one(session, name, one, stores, claims, journals, prove)
        except (DvtcliError, KeyboardInterrupt) as fault:
            stores.failed[one.node_id] = fault
            if stores.lost or not isinstance(fault, DeviceRefused):
                raise
            if fault.state != "unknown":
                stores.states[one.node_id] = stores.states[one.node_id]._replace(is_refused=True)

    jobs = [partial(store, state) for state in states if state.waits]
    faults = one_by_one(jobs)  # not side by side: wherever this ends, nobody knows of one node at most
    if faults and not stores.failed:
        raise faults[0]
    others = [] if stores.lost or stores.failed else one_by_one([claims.others.verify])
    stores.lost = stores.lost or claims.verify_after_stores()
    if stores.lost:
        left = lost_settings(name, stores, stores.lost)
        if stores.are_all_done():
            left.details += [("also", text) for text in _note_states(name, stores, journals)]
        raise left from stores.lost[0]
    if stores.failed:
        not_noted = _note_states(name, stores, journals)
        unstamped, stamped = _end_stamps(session, stores, claims)
        left = not_all_stored(stores, [journal.path for journal in journals if journal.is_begun], unstamped)
        left.details += [("also", text) for text in (*not_noted, *stamped)]
        raise left from next(iter(stores.failed.values()))
    others = others or one_by_one([claims.others.verify_restarted])  # what was read of them first may be lost by now
    if others:
        raise lost_besides(stores, others[0]) from others[0]
    return tuple(stores.answers[state.node_id] for state in states if state.node_id in stores.answers)


def _store_one(
    session: SessionNodes,
    name: str,
    one: Storing,
    stores: Stores,
    claims: ExpectedAtStore,
    journals: Sequence[OwnJournal],
    prove: str | None,
) -> None:
    stores.states[one.node_id] = one = one._replace(is_begun=True, is_refused=False)
    states = tuple(stores.states.values())
    for journal in _to_note(journals, one.node_id):
        journal.record_stores(_final(name, states, one), states, stores.equal)
    node = claims.nodes[one.node_id]
    node.pending.stores += 1  # whatever becomes of it, no script takes its lines back any more
    try:
        try:
            claims.verify_before_store(one.node_id)
        except DvtcliError as other:
            stores.lost.append(other)
            raise
        stores.answers[one.node_id] = store_settings(
            session, node, store_group(one.group), prove=prove, is_part_of_group=True
        )
    except (SafetyRefusal, LeftChanged) as other:  # another device, or what tested the store is left on it
        stores.lost = [other, *(exception for exception in stores.lost if exception is not other)]
        raise
    stores.states[one.node_id] = one._replace(is_done=True)
    _say_too_late(session, stores)


def _note_states(name: str, stores: Stores, journals: Sequence[OwnJournal]) -> list[str]:
    """Record the result of the stores in *journals*; returns errors."""
    failures: list[str] = []
    states = tuple(stores.states.values())
    line = f"{name}: store on node {', '.join(str(state.node_id) for state in states)}"
    for journal in (journal for journal in journals if journal.is_begun):
        try:
            journal.record_stores(line, states, stores.equal)
        except DvtcliError as failed:
            failures.append(failed.text)
    return failures


def _say_too_late(session: SessionUser, stores: Stores) -> None:
    """After a request to stop during a store: report who has stored, and that the others go on."""
    rest = [str(state.node_id) for state in stores.states.values() if state.waits]
    if session.cancellation.requested and rest and not stores.was_late:
        stores.was_late = True
        done = [str(state.node_id) for state in stores.states.values() if state.is_done]
        session.reporter.warning(
            f"too late to stop before the stores: node {', '.join(done)} has stored; node {', '.join(rest)} still "
            f"stores, so that all keep the same configuration (Ctrl-C again: stop at once)"
        )


def _to_note(journals: Sequence[OwnJournal], node_id: int) -> Sequence[OwnJournal]:
    """Return the journals that record the start of the store of *node_id*: all for the first store.

    Later its own journal suffices, else any: a reader takes the most advanced record (`newest_store_record`).
    """
    ours = [journal for journal in journals if journal.is_begun]
    if not all(journal.says_stores for journal in ours):
        return ours
    return [journal for journal in ours if journal.lock.node_id == node_id] or ours[:1]


def _final(name: str, states: Iterable[Storing], one: Storing) -> str:
    """Describe the progress for a `recover` if this process ends in the middle."""
    done = [str(before.node_id) for before in states if before.is_done]
    stored = f"; stored on node {', '.join(done)}" if done else ""
    return f"{name}: store on node {one.node_id}{stored}"

"""Store on the nodes of a verified network change, without roll-back; and what is known of unfinished stores."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.bus.turns import one_by_one
from dvtcli.device.change.change_group import Storing
from dvtcli.device.change.failed_change import BUS_BACK, also_lines, brought_back_first
from dvtcli.device.change.own_journal import complete_groups
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.store import ProveBy, WhoStored
from dvtcli.domain.text import all_nodes, join_some, some_nodes
from dvtcli.errors import (
    BusUnavailable,
    DeviceRefused,
    DvtcliError,
    JournalKept,
    LeftChanged,
    NoAnswer,
    SafetyRefusal,
    SdoProtocolError,
)
from dvtcli.operations.changes.possible_stores import store_group
from dvtcli.operations.changes.store_restore import end_stamp, store_settings

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from dvtcli.device.change.own_journal import OwnJournal
    from dvtcli.operations.changes.network_phases import ClaimsAtStore
    from dvtcli.operations.changes.network_transaction import NetworkTransaction
    from dvtcli.operations.results import Stored
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


def store_network(
    session: SessionNodes,
    transaction: NetworkTransaction,
    stores: tuple[Storing, ...],
    at_store: ClaimsAtStore,
    prove: ProveBy | None,
    equal: tuple[Storing, ...] = (),
) -> tuple[Stored, ...]:
    """Carry out *stores* node by node; LeftChanged names the nodes that have stored and those that have not.

    *equal* are nodes that were as wanted and neither change nor store: the journals name them.

    Each node is verified against its claims *at_store* right before its store, and all nodes again after the last
    store. From the first store on the journals record the stores; they stay if some stores are missing: `recover`
    completes or rolls back.
    """
    if not stores:
        return ()
    on_way = Stores({storing.node_id: storing for storing in stores}, equal)
    try:
        return store_each(session, transaction.name, on_way, at_store, transaction.journals(), prove)
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


def _end_stamps(session: SessionUser, stores: Stores, at_store: ClaimsAtStore) -> tuple[list[int], list[str]]:
    """End the stamps of nodes that could not store: `--trust-stamp` would trust them otherwise.

    Returns the nodes with an ended stamp, and the errors of others.
    """
    ended, failures = list[int](), list[str]()
    for state in stores.states.values():
        if not state.waits:
            continue
        try:
            if end_stamp(session, at_store.nodes[state.node_id], "a node that does not store has no stamp"):
                ended.append(state.node_id)
        except DvtcliError as failed:
            failures.append(f"0x1020 of node {state.node_id} may mark it as stored: {failed.text}")
    return ended, failures


def store_each(
    session: SessionNodes,
    name: str,
    stores: Stores,
    at_store: ClaimsAtStore,
    journals: Sequence[OwnJournal],
    prove: ProveBy | None = None,
) -> tuple[Stored, ...]:
    """Carry out the missing *stores* of the change *name*; *journals* record the progress.

    Each node is verified against its claims *at_store* right before its store, and all again after the last store. A
    refusal does not prevent other stores. LeftChanged names stored and missing nodes; *stores* says whether a node lost
    values.
    """
    states = list(stores.states.values())

    def store(one: Storing) -> None:
        try:
            _store_one(session, name, one, stores, at_store, journals, prove)
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
    others = [] if stores.lost or stores.failed else one_by_one([at_store.others.verify])
    stores.lost = stores.lost or at_store.verify_after_stores()
    if stores.lost:
        left = lost_settings(name, stores, stores.lost)
        if stores.are_all_done():
            left.details += [("also", text) for text in _note_states(name, stores, journals)]
        raise left from stores.lost[0]
    if stores.failed:
        not_noted = _note_states(name, stores, journals)
        unstamped, stamped = _end_stamps(session, stores, at_store)
        left = not_all_stored(stores, [journal.path for journal in journals if journal.is_begun], unstamped)
        left.details += [("also", text) for text in (*not_noted, *stamped)]
        raise left from next(iter(stores.failed.values()))
    others = others or one_by_one([at_store.others.verify_restarted])  # what was read of them first may be lost by now
    if others:
        raise lost_besides(stores, others[0]) from others[0]
    return tuple(stores.answers[state.node_id] for state in states if state.node_id in stores.answers)


def _store_one(
    session: SessionNodes,
    name: str,
    one: Storing,
    stores: Stores,
    at_store: ClaimsAtStore,
    journals: Sequence[OwnJournal],
    prove: ProveBy | None,
) -> None:
    stores.states[one.node_id] = one = one._replace(is_begun=True, is_refused=False)
    states = tuple(stores.states.values())
    for journal in _to_note(journals, one.node_id):
        journal.record_stores(_final(name, states, one), states, stores.equal)
    node = at_store.nodes[one.node_id]
    node.pending.stores += 1  # whatever becomes of it, no script takes its lines back any more
    try:
        try:
            at_store.verify_before_store(one.node_id)
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
    line = f"{name}: store on {all_nodes([state.node_id for state in states])}"
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
            f"too late to stop before the stores: {all_nodes(done)} stored already; {all_nodes(rest)} will "
            f"store, too, so that all keep the same configuration (Ctrl-C again: stop at once)"
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
    stored = f"; stored on {all_nodes(done)}" if done else ""
    return f"{name}: store on node {one.node_id}{stored}"


#: What to do if a node lost its values, without a journal.
_AGAIN = Hint(Action.APPLY, why="{} again sets the missing values, and stores them")
_ALL_BACK = Hint(Action.RECOVER_ALL, why=", {} puts every node back")


@dataclass(slots=True)
class Stores:
    """The stores of a whole change in progress, by node-ID; *lost*: faults of nodes that lost values.

    *equal* are nodes that were as wanted and neither change nor store.
    """

    states: dict[int, Storing]
    equal: tuple[Storing, ...] = ()
    answers: dict[int, Stored] = field(default_factory=dict)
    failed: dict[int, BaseException] = field(default_factory=dict)
    lost: list[BaseException] = field(default_factory=list)
    #: whether the message about a late request to stop was shown
    was_late: bool = False

    def are_all_done(self) -> bool:
        """Tell whether every node has acknowledged its store."""
        return not any(state.waits for state in self.states.values())


def not_all_stored(stores: Stores, journals: Sequence[Path], unstamped: Sequence[int]) -> LeftChanged:
    """Report failed stores while every node still holds its planned values.

    *journals* allow a roll-back or the missing stores. The planned stamps of the *unstamped* nodes are 0, as these have
    not stored.
    """
    first, fault = next(iter(stores.failed.items()))
    refused = [node_id for node_id, failure in stores.failed.items() if not _is_unsure(failure)]
    spoilt = [node_id for node_id, failure in stores.failed.items() if _is_spoilt(failure)]
    unsure = [node_id for node_id in stores.failed if node_id not in (*refused, *spoilt)]
    said = [f"whether {some_nodes(unsure)} stored it is not known"] if unsure else []
    said += [_spoilt_text(spoilt)] if spoilt else []
    said += [f"{some_nodes(refused)} did not store it"] if refused else []
    left = LeftChanged(
        f"{_held(stores, unstamped)}, and {', and '.join(said)}",
        node=first,
        place=fault.place if isinstance(fault, DvtcliError) else None,
        why="; ".join(str(exception) or "interrupted" for exception in stores.failed.values()),
        hint=Hint(Action.FINISH_STORES, why="lets the remaining nodes store").after(
            brought_back_first(fault.hint if isinstance(fault, DvtcliError) else None)
        )
        + _ALL_BACK,
        state="left_changed",
    )
    _say_who(stores, left)
    if journals:
        left.details.append(("journals", join_some(map(str, journals))))
    left.state_text = f"{_held(stores, unstamped)}, read back equal; not all of them have stored it"
    return left


def _held(stores: Stores, unstamped: Sequence[int]) -> str:
    """Say who holds planned values: accepted nodes are unverified; a stamp is 0 until its node stores."""
    accepted = [node_id for node_id, state in stores.states.items() if state.is_accepted]
    who = f"every node except {join_some(map(str, accepted))}, accepted as found," if accepted else "every node"
    but = f" but the stamp of {some_nodes(unstamped)}, which is 0 until the node has stored" if unstamped else ""
    return f"{who} has the planned values{but}"


def only_some_stored(node_ids: Sequence[int], outcomes: Mapping[int, Stored | BaseException]) -> LeftChanged | None:
    """Report that only some of *node_ids*, stored one by one, have stored; None if none or all did.

    *outcomes* has the answer or the error of each node asked.
    """
    faults = {node_id: outcome for node_id, outcome in outcomes.items() if isinstance(outcome, BaseException)}
    answers = {node_id: outcome for node_id, outcome in outcomes.items() if not isinstance(outcome, BaseException)}
    stored = tuple(node_id for node_id, answer in answers.items() if answer.stored)
    kept = [*stored, *(node_id for node_id, answer in answers.items() if answer.skipped)]
    unsure = tuple(node_id for node_id, fault in faults.items() if _is_unsure(fault))
    spoilt = [node_id for node_id, fault in faults.items() if _is_spoilt(fault)]
    unknown = [node_id for node_id in unsure if node_id not in spoilt]
    missing = tuple(node_id for node_id in node_ids if node_id not in (*kept, *unsure))
    if not stored or not (unsure or missing):
        return None
    said = [f"{some_nodes(missing)} did not"] if missing else []
    said += [_spoilt_text(spoilt)] if spoilt else []
    said += [f"whether {some_nodes(unknown)} stored is not known"] if unknown else []
    first = next(iter(faults.values()), None)
    error = LeftChanged(
        f"{some_nodes(stored)} stored, and {', and '.join(said)}",
        node=(*missing, *unsure)[0],
        place=first.place if isinstance(first, DvtcliError) else None,
        why="; ".join(f"node {node_id}: {str(fault) or 'interrupted'}" for node_id, fault in faults.items()) or None,
        hint=Hint(Action.STORE, {"node": sorted((*missing, *unsure))}, "stores the rest").after(
            BUS_BACK if any(isinstance(fault, BusUnavailable) for fault in faults.values()) else None
        ),
        state="left_changed",
    )
    error.stores = WhoStored(stored, missing, unsure)
    error.details = error.stores.rows()
    error.state_text = "the stored values stay stored"
    return error


def only_some_restored(node_ids: Sequence[int], outcomes: Mapping[int, Stored | BaseException]) -> LeftChanged | None:
    """Report that only some of *node_ids*, one by one, restored their defaults; None if none or all did alike."""
    faults = {node_id: outcome for node_id, outcome in outcomes.items() if isinstance(outcome, BaseException)}
    answers = {node_id: outcome for node_id, outcome in outcomes.items() if not isinstance(outcome, BaseException)}
    restored = [node_id for node_id, answer in answers.items() if answer.exit_code == 0]
    unproved = [node_id for node_id in answers if node_id not in restored]
    unsure = [node_id for node_id, fault in faults.items() if _is_unsure(fault)]
    missing = [node_id for node_id in node_ids if node_id not in (*answers, *unsure)]
    if not answers or len(node_ids) in (len(restored), len(unproved)):
        return None
    rest = sorted((*unproved, *unsure, *missing))
    said = [f"{some_nodes(restored)} restored the defaults"] if restored else []
    said += [f"{some_nodes(unproved)} may not have the defaults (not proved)"] if unproved else []
    said += [f"{some_nodes(missing)} did not"] if missing else []
    said += [f"whether {some_nodes(unsure)} restored them is not known"] if unsure else []
    return LeftChanged(
        ", and ".join(said),
        node=rest[0],
        why="; ".join(f"node {node_id}: {str(fault) or 'interrupted'}" for node_id, fault in faults.items()) or None,
        hint=Hint(Action.RESTORE, {"node": rest}, "restores the rest"),
        state="left_changed",
    )


def lost_besides(stores: Stores, lost: BaseException) -> LeftChanged:
    """Report that all written values are held and stored, but another planned value differs."""
    left = LeftChanged(
        f"every node that was written stored, and then: {lost}",
        node=lost.node if isinstance(lost, DvtcliError) else None,
        place=lost.place if isinstance(lost, DvtcliError) else None,
        why=lost.why if isinstance(lost, DvtcliError) else None,
        hint=_AGAIN,
        state="left_changed",
    )
    _say_who(stores, left)
    left.state_text = "every other node has the planned values and has stored them"
    return left


def back_and_again(name: str, who: str = "every node") -> Hint:
    """Suggest the roll-back for *who*, then *name* again: for all nodes, whichever is selected."""
    back = Hint(Action.RECOVER_ALL, why=f"rolls {who} back")
    command, _, file = name.partition(" ")
    if command == "apply" and file:
        return back + Hint(Action.APPLY_NETWORK, {"file": file}, "then {} again")
    return back + f"then {name} again"


def lost_settings(name: str, stores: Stores, lost: Sequence[BaseException]) -> LeftChanged:
    """Report nodes that no longer hold planned values (*lost*): nothing of these must be stored.

    *name* is the name of the change.
    """
    first, *others = lost
    left = LeftChanged(
        _lost_text(stores, first),
        node=first.node if isinstance(first, DvtcliError) else None,
        place=first.place if isinstance(first, DvtcliError) else None,
        why=(first.why if isinstance(first, DvtcliError) else None) or "seen while the nodes stored",
        hint=back_and_again(name),
        state="left_changed",
    )
    is_gone = isinstance(first, BusUnavailable)
    if is_gone or (stores.are_all_done() and not isinstance(first, DvtcliError)):
        goes_on = "reads every node again" if stores.are_all_done() else "continues with the stores"
        left.hint = Hint(Action.FINISH_STORES, why=goes_on).after(BUS_BACK if is_gone else None) + _ALL_BACK
    if isinstance(first, LeftChanged):
        finish = Hint(Action.FINISH_STORES, why="rolls that back and continues the stores")
        left.hint = finish.after(brought_back_first(first.hint)) + _ALL_BACK
        left.details += first.details
    left.details += also_lines(left, others)
    _say_who(stores, left)
    left.state_text = "not every node is known to have the planned values; stored values remain stored"
    return left


def _lost_text(stores: Stores, first: BaseException) -> str:
    if isinstance(first, BusUnavailable) and stores.are_all_done():
        return f"all nodes have stored, but the bus failed before every node was read again: {first}"
    if isinstance(first, BusUnavailable):
        return f"the bus was gone while the nodes stored: {first}"
    return str(first) or "stopped before every node was read again"


def _say_who(stores: Stores, left: LeftChanged) -> None:
    """Add stored, missing and unknown nodes to *left*, for screens and programs."""
    done = tuple(state.node_id for state in stores.states.values() if state.is_done)
    unsure = tuple(node_id for node_id, failure in stores.failed.items() if _is_unsure(failure))
    missing = tuple(state.node_id for state in stores.states.values() if state.waits and state.node_id not in unsure)
    lost = {fault.node for fault in stores.lost if isinstance(fault, DeviceRefused)}
    not_held = tuple(node_id for node_id in done if node_id in lost)
    left.stores = WhoStored(tuple(node_id for node_id in done if node_id not in lost), missing, unsure, not_held)
    left.details += left.stores.rows()


def _spoilt_text(spoilt: Sequence[int]) -> str:
    return f"{some_nodes(spoilt)} refused to store: the stored values are unknown"


def _is_spoilt(fault: BaseException) -> bool:
    """Tell whether a store failed in the node, so that its stored parameters may be lost."""
    return isinstance(fault, DeviceRefused) and fault.abort is not None and fault.state == "unknown"


def _is_unsure(fault: BaseException) -> bool:
    """Tell whether it is unknown if the node stored."""
    if not isinstance(fault, DvtcliError):
        return True
    lost = isinstance(fault, BusUnavailable | NoAnswer | SdoProtocolError)
    return lost or fault.state in ("unknown", "left_changed")


def hint_without_journal(lost: BaseException, acknowledged: Collection[int] = ()) -> Hint | str | None:
    """Suggest a remedy if *lost* values are in no journal."""
    if isinstance(lost, LeftChanged):
        return lost.hint
    if isinstance(lost, DeviceRefused) and lost.node is not None and lost.node in acknowledged:
        why = "{} shows whether the stored values survive a reset; the manual of the node describes how it stores"
        return Hint(Action.PROVE_STORE, {"node": (lost.node,)}, why)
    return _AGAIN.after(BUS_BACK if isinstance(lost, BusUnavailable) else None)

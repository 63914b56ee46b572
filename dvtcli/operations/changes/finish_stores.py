"""Complete the interrupted stores of a network: verified nodes are stored.

Rolls nothing back (`recover_change`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.change.recovery import refuse_other_device
from dvtcli.device.stamped import held_stamp, is_stamp, stamp_changes
from dvtcli.device.store.canary import holds_test, roll_back_test
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.plan import PdoChange, Plan, ValueChange
from dvtcli.domain.store import DATE, TIME, Stamp
from dvtcli.domain.text import all_nodes, join_some, some_nodes
from dvtcli.errors import DeviceRefused, SafetyRefusal, UsageError
from dvtcli.operations.changes.network_phases import ClaimsAtStore
from dvtcli.operations.changes.store_network import Stores, back_and_again, store_each
from dvtcli.operations.changes.waiting_journals import newest_store_record, waiting
from dvtcli.operations.results import Facts

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dvtcli.device.change.change_group import GroupMember, Storing
    from dvtcli.device.change.journal import Journal
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.plan import Change
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.user.session_user import SessionUser


def may_finish(journals: Sequence[Journal]) -> bool:
    """Tell whether *journals* are of the same change, with all nodes verified before the stores."""
    groups = {journal.member.group_id for journal in journals}
    return len(groups) == 1 and bool(
        newest_store_record(journals).stores
    )  # one that only tests a proof says of no stores


def finish_group_stores(session: Session, journals: Sequence[Journal]) -> Facts:
    """Verify all nodes of *journals* again, store the missing nodes, remove the journals.

    Raises UsageError if not all nodes were verified before; SafetyRefusal, without a store, if a value differs by now;
    LeftChanged if a node did not store: the journals stay.
    """
    one = next((begun_journal for begun_journal in journals if may_finish([begun_journal])), None)
    if one is not None and not may_finish(journals):
        raise UsageError(
            "the stores of several networks were interrupted; finish one network at a time",
            given={"finish": True},
            hint=Hint(Action.FINISH_STORES, {"node": one.plan.node_id}, f"continues with {verbatim(one.member.name)}"),
        )
    if not may_finish(journals):
        raise UsageError(
            "not all nodes had been verified: there is nothing to finish",
            hint=Hint(Action.RECOVER_ALL, why="rolls them back"),
        )
    member = newest_store_record(journals)
    nodes = {storing.node_id: session.node(storing.node_id) for storing in _verified(member)}
    nodes |= {journal.plan.node_id: session.node(journal.plan.node_id) for journal in journals}
    _refuse_undecided(journals, member)
    for journal in journals:
        refuse_other_device(nodes[journal.plan.node_id], journal)
    at_store = _claims_at_store(session, journals, member, nodes)
    tests = {
        begun_journal.plan.node_id: begun_journal.member.tests
        for begun_journal in journals
        if holds_test(nodes[begun_journal.plan.node_id], begun_journal.member.tests)
    }
    with_tests = {
        begun_journal.plan.node_id: _tested(at_store.changes[begun_journal.plan.node_id], begun_journal)
        for begun_journal in journals
        if begun_journal.plan.node_id in tests
    }
    stamps = _ended_stamps(at_store, member)
    claimed = {**at_store.changes, **with_tests}
    claimed |= {node_id: [change for change in claimed[node_id] if not is_stamp(change)] for node_id in stamps}
    for node_id in nodes:
        _refuse_unlike(replace(at_store, changes=claimed), node_id, member.name)
    to_store = all_nodes(waiting(member)) if waiting(member) else ""
    what = f"{_not_looked_at(member)}; " + (f"store on {to_store}?" if to_store else "is it to stay so?")
    had_stored = "" if to_store else _had_stored(member)
    who = "every node has"
    if _accepted_ids(member):
        who = f"{some_nodes(sorted(nodes))} {'has' if len(nodes) == 1 else 'have'}"
    but = f" but the stamp of {some_nodes(stamps)}, which is written before the stores" if stamps else ""
    session.consent(f"{member.name}: {who} the planned values{but}{had_stored}{what}")
    _store(session, journals, member, at_store, tests, stamps)
    rows = (
        ("node", None),
        ("recovered", False),
        ("finished", not session.dry_run),
        ("stored", waiting(member)),
        ("looked_at", sorted(nodes)),
        ("not_looked_at", _accepted_ids(member)),
    )
    changed_nothing = session.dry_run or not (to_store or tests)
    return Facts("recover", rows, (_said(session, member, who, to_store),), changed_nothing=changed_nothing)


def _verified(member: GroupMember) -> tuple[Storing, ...]:
    """Return the nodes of *member* that must still hold verified values, except accepted nodes."""
    return tuple(storing for storing in (*member.stores, *member.equal) if not storing.is_accepted)


def _refuse_undecided(journals: Sequence[Journal], member: GroupMember) -> None:
    """Raises SafetyRefusal if no journal has a node's wanted values: its own was closed, or is unusable."""
    own = {journal.plan.node_id for journal in journals}
    undecided = [
        store.node_id for store in member.stores if store.node_id not in own and not (store.holds or store.is_accepted)
    ]
    if undecided:
        nodes = some_nodes(undecided)
        raise SafetyRefusal(
            f"the planned values of {nodes} are unknown: nothing is stored",
            node=undecided[0],
            why=f"no usable journal for {nodes}",
            hint=back_and_again(member.name, "the other nodes"),
        )


def _said(session: SessionUser, member: GroupMember, who_has: str, stored: str) -> str:
    """Report: *who_has* the values was verified only; the nodes *stored* stored, if not empty."""
    if session.dry_run:
        said = f"{stored} would store" if stored else f"{who_has} it{_had_stored(member)}; the journals are kept"
        return f"dry run: {said}{_not_looked_at(member)}"
    done = f"{stored} stored" if stored else f"{who_has} it{_had_stored(member)}"
    outcome = "ended" if _accepted_ids(member) else "complete"
    return f"{member.name} is {outcome}: {done}{_not_looked_at(member)}"


def _had_stored(member: GroupMember) -> str:
    """Name the nodes stored before; empty if none is still part of it."""
    ids = [store.node_id for store in member.stores if store.is_done and not store.is_accepted]
    return f", and {some_nodes(ids)} had stored it" if ids else ""


def _accepted_ids(member: GroupMember) -> list[int]:
    """List nodes whose journals were accepted: not verified any more."""
    return [store.node_id for store in member.stores if store.is_accepted]


def _not_looked_at(member: GroupMember) -> str:
    ids = _accepted_ids(member)
    return f"; accepted as found, not read: {some_nodes(ids)}" if ids else ""


def _claims_at_store(
    session: Session, journals: Sequence[Journal], member: GroupMember, nodes: Mapping[int, Node]
) -> ClaimsAtStore:
    """Collect the verified values of every node from the journals.

    Nodes that only store or test a proof have no values in their own journal.
    """
    changes = {storing.node_id: storing.holds for storing in _verified(member)}
    changes |= {
        journal.plan.node_id: (*changes.get(journal.plan.node_id, ()), *_wanted(journal)) for journal in journals
    }
    identities = {storing.node_id: storing.identity for storing in _verified(member) if storing.identity is not None}
    identities |= {journal.plan.node_id: journal.identity for journal in journals}
    silent = {node for node in nodes if node not in {store.node_id for store in member.stores}}
    boot_ups = {silent_id: nodes[silent_id].bus.boot_ups(silent_id) for silent_id in silent}
    return ClaimsAtStore(session, nodes, changes, identities, boot_ups)


def _wanted(journal: Journal) -> tuple[Change, ...]:
    """Return the wanted values of *journal*'s node, without test values of a store."""
    tested = {test.label: test for test in journal.member.tests}
    return tuple(
        _without(change, tested[change.label]) if change.label in tested else change for change in journal.plan.changes
    )


def _without(change: Change, test: Change) -> Change:
    """Remove *test* from the end of *change*."""
    if isinstance(change, PdoChange):
        return change._replace(after=test.before) if isinstance(test, PdoChange) else change
    before = change.step.before if isinstance(test, PdoChange) else test.step.before
    return ValueChange(replace(change.step, after=before or b""))


def _tested(holds: Sequence[Change], journal: Journal) -> tuple[Change, ...]:
    """Return the test values of a store that a node still *holds*."""
    tested = {test.label for test in journal.member.tests}
    others = (hold for hold in holds if hold.label not in tested)
    return (*others, *(change for change in journal.plan.changes if change.label in tested))


def _store(
    session: Session,
    journals: Sequence[Journal],
    member: GroupMember,
    at_store: ClaimsAtStore,
    tests: Mapping[int, Sequence[Change]],
    stamps: Mapping[int, Sequence[Change]],
) -> None:
    """Roll back *tests* on nodes that hold them, write ended *stamps* again, and store as in *member*.

    Removes the journals.
    """
    nodes, transaction = at_store.nodes, Stores({store.node_id: store for store in member.stores}, member.equal)
    guards = [] if session.dry_run else [node.guard for node in nodes.values() if node.guard is not None]
    waited = {journal.plan.node_id: journal for journal in journals}
    with session.cancellation.deferred(), session.agreed():
        session.group.id, session.group.name = member.group_id, member.name
        for node_id, changes in at_store.changes.items():
            for change in changes:  # the store itself looks at that, too, and at nothing else that was not changed
                nodes[node_id].expected.changed(change)
        try:
            for guard in guards:
                if guard.node_id in waited:
                    guard.own_journal.adopt(waited[guard.node_id])
            _roll_back_tests(nodes, tests)
            for node_id, changes in stamps.items():
                nodes[node_id].apply(Plan(node_id, tuple(changes)), remembered=False)
            store_each(session, member.name, transaction, at_store, [guard.own_journal for guard in guards])
            for guard in guards:
                guard.own_journal.complete_group()
        finally:
            session.group.end()
            for guard in guards:
                guard.own_journal.detach()
        for journal in journals:
            _start(nodes[journal.plan.node_id], journal)


def _ended_stamps(at_store: ClaimsAtStore, member: GroupMember) -> dict[int, tuple[Change, ...]]:
    """Map nodes to stamps to write again before their stores: a refused store ended them."""
    found: dict[int, tuple[Change, ...]] = {}
    for node_id in waiting(member):
        wanted = {change.step.sub_index: change.step.after for change in at_store.changes[node_id] if is_stamp(change)}
        stamp = Stamp(*(int.from_bytes(wanted.get(stamp_place, b""), "little") for stamp_place in (DATE, TIME)))
        held = held_stamp(at_store.nodes[node_id]) if stamp.is_own else None
        if held is not None and held != stamp and 0 in (held.days, held.ms):
            found[node_id] = stamp_changes(held, stamp, f"stamp: {stamp}")
    return found


def _roll_back_tests(nodes: Mapping[int, Node], tests: Mapping[int, Sequence[Change]]) -> None:
    for node_id, changes in tests.items():
        nodes[node_id].gate.enter()
        roll_back_test(nodes[node_id], changes, join_some(change.label for change in changes))


def _refuse_unlike(at_store: ClaimsAtStore, node_id: int, name: str) -> None:
    try:
        at_store.verify_before_store(node_id)
    except DeviceRefused as other:
        raise SafetyRefusal(
            f"the values of node {node_id} differ from those verified: nothing is stored",
            node=node_id,
            why=other.why,
            hint=back_and_again(name),
        ) from other


def _start(node: ReadableNode, journal: Journal) -> None:
    """Start a node that was OPERATIONAL before the change."""
    if journal.nmt_state == NmtState.OPERATIONAL and node.access.state() is NmtState.PRE_OPERATIONAL:
        node.access.insist(NmtState.OPERATIONAL)

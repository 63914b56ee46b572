"""Storing on the nodes of a network, once all of them are verified: from the first store on nothing is taken back.

Does not know what was changed.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.bus.turns import one_by_one
from dvtcli.device.change.own_journal import complete_wholes
from dvtcli.device.change.whole import Storing
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, SafetyRefusal
from dvtcli.operations.stores.possible_stores import store_group
from dvtcli.operations.stores.store_restore import end_stamp, store_settings
from dvtcli.operations.stores.unfinished_stores import (
    Stores,
    hint_without_journal,
    lost_besides,
    lost_settings,
    not_all_stored,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dvtcli.device.change.own_journal import OwnJournal
    from dvtcli.operations.changes.final_verify import Verified
    from dvtcli.operations.changes.take_back_network import Course
    from dvtcli.operations.results import Stored
    from dvtcli.operations.session.session import Session


def store_network(
    session: Session,
    course: Course,
    stores: tuple[Storing, ...],
    verified: Verified,
    prove: str | None,
    equal: tuple[Storing, ...] = (),
) -> tuple[Stored, ...]:
    """Carry *stores* out, one node after the other; LeftChanged names who has stored and who has not.

    *equal* are the nodes that were as wanted already, and neither are changed nor store: the journals name them.

    Each node is looked at right before its store, and all of them, as they were *verified*, once more after the last.
    A journal says from here on that stores have begun; the journals stay if not all have stored what was planned:
    `recover` goes on, or back.
    """
    if not stores:
        return ()
    on_way = Stores({one.node_id: one for one in stores}, equal)
    try:
        return store_each(session, course.name, on_way, verified, course.journals(), prove)
    except BaseException as fault:
        if isinstance(fault, LeftChanged) and not (on_way.lost or on_way.failed):
            kept = complete_wholes(course.journals())  # all have stored: nothing of that is to be taken back
            if kept is not None:
                fault.details.append(("also", f"{kept.text}: {kept.why}"))
        elif isinstance(fault, LeftChanged) and not course.journals():
            done = [one.node_id for one in on_way.states.values() if one.is_done]
            cause = on_way.lost[0] if on_way.lost else next(iter(on_way.failed.values()), fault)
            fault.hint = hint_without_journal(cause, done)
        for journal in course.journals():
            journal.is_over()
        raise


def _end_stamps(session: Session, course: Stores, verified: Verified, left: LeftChanged) -> None:
    """What could not be stored is not stamped: elsewhere `--trust-stamp` would believe it."""
    for one in course.states.values():
        if one.is_done:
            continue
        try:
            end_stamp(session, verified.nodes[one.node_id], "what is not stored has no stamp")
        except DvtcliError as failed:
            left.details.append(("also", f"0x1020 of node {one.node_id} may say that it is stored: {failed.text}"))


def store_each(
    session: Session,
    name: str,
    course: Stores,
    verified: Verified,
    journals: Sequence[OwnJournal],
    prove: str | None = None,
) -> tuple[Stored, ...]:
    """Carry out what *course* has not done, the end of what is called *name*; *journals* say how far it is.

    Each node is asked for what was *verified* right before it stores, and all of them once more behind the last store.
    A node that refuses does not keep the others from being asked. LeftChanged names who has stored and who has not;
    *course* says then whether a node held something else.
    """
    stores = list(course.states.values())

    def store(one: Storing) -> None:
        try:
            _store_one(session, name, one, course, verified, journals, prove)
        except (DvtcliError, KeyboardInterrupt) as fault:
            course.failed[one.node_id] = fault
            if course.lost or not isinstance(fault, DeviceRefused):
                raise
            if fault.state != "unknown":
                course.states[one.node_id] = replace(course.states[one.node_id], is_refused=True)

    jobs = [partial(store, one) for one in stores if not one.is_done]
    faults = one_by_one(jobs)  # not side by side: wherever this ends, nobody knows of one node at most
    if faults and not course.failed:
        raise faults[0]
    others = [] if course.lost or course.failed else one_by_one([verified.verify_others])
    course.lost = course.lost or verified.faults()
    if course.lost:
        left = lost_settings(course, course.lost)
        if course.are_all_done():
            _note_states(name, course, journals, left)
        raise left from course.lost[0]
    if course.failed:
        left = not_all_stored(course, [journal.path for journal in journals if journal.is_begun])
        _note_states(name, course, journals, left)
        _end_stamps(session, course, verified, left)
        raise left from next(iter(course.failed.values()))
    others = others or one_by_one([verified.refuse_restarted])  # what was read of them first may be lost by now
    if others:
        raise lost_besides(course, others[0]) from others[0]
    return tuple(course.answers[one.node_id] for one in stores if one.node_id in course.answers)


def _store_one(
    session: Session,
    name: str,
    one: Storing,
    course: Stores,
    verified: Verified,
    journals: Sequence[OwnJournal],
    prove: str | None,
) -> None:
    course.states[one.node_id] = one = replace(one, is_begun=True, is_refused=False)
    states = tuple(course.states.values())
    for journal in _to_note(journals, one.node_id):
        journal.final(_final(name, states, one), states, course.equal)
    node = verified.nodes[one.node_id]
    node.pending.stores += 1  # whatever becomes of it, no script takes its lines back any more
    try:
        try:
            verified.require(one.node_id)
        except DvtcliError as other:
            course.lost.append(other)
            raise
        course.answers[one.node_id] = store_settings(session, node, store_group(one.group), prove=prove)
    except (SafetyRefusal, LeftChanged) as other:  # another device, or what tested the store is left on it
        course.lost = [other, *(one for one in course.lost if one is not other)]
        raise
    course.states[one.node_id] = replace(one, is_done=True)
    _say_too_late(session, course)


def _note_states(name: str, course: Stores, journals: Sequence[OwnJournal], left: LeftChanged) -> None:
    """Let *journals* say how the stores ended; what keeps one from it is said beside what is *left*."""
    states = tuple(course.states.values())
    line = f"{name}: store on node {', '.join(str(one.node_id) for one in states)}"
    for journal in (journal for journal in journals if journal.is_begun):
        try:
            journal.final(line, states, course.equal)
        except DvtcliError as failed:
            left.details.append(("also", failed.text))


def _say_too_late(session: Session, course: Stores) -> None:
    """Where a request to stop came while a node stored: who has stored, and that the others do so, too."""
    rest = [str(one.node_id) for one in course.states.values() if not one.is_done]
    if session.cancellation.requested and rest and not course.was_late:
        course.was_late = True
        done = [str(one.node_id) for one in course.states.values() if one.is_done]
        session.tell.warning(
            f"too late to stop before the stores: node {', '.join(done)} has stored; node {', '.join(rest)} still "
            "stores, so that all keep the same (once more: at once)"
        )


def _to_note(journals: Sequence[OwnJournal], node_id: int) -> Sequence[OwnJournal]:
    """The journals that say of the store of *node_id* that it begins: all of them where none says of a store yet.

    After that its own one is enough, else any: who reads them takes the one that says most (`furthest`).
    """
    ours = [journal for journal in journals if journal.is_begun]
    if not all(journal.says_stores for journal in ours):
        return ours
    return [journal for journal in ours if journal.lock.node_id == node_id] or ours[:1]


def _final(name: str, states: Iterable[Storing], one: Storing) -> str:
    """What a `recover` says had begun, where this process ends in the middle of it."""
    done = [str(before.node_id) for before in states if before.is_done]
    stored = f"; stored on node {', '.join(done)}" if done else ""
    return f"{name}: store on node {one.node_id}{stored}"

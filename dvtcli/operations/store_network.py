"""Storing on the nodes of a network, once all of them are verified: from the first store on nothing is taken back.

Does not know what was changed.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.bus.turns import one_by_one
from dvtcli.device.change.whole import Storing
from dvtcli.errors import DvtcliError, LeftChanged, NoAnswer, SdoProtocolError
from dvtcli.operations.possible_stores import store_group
from dvtcli.operations.store_restore import store_settings

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dvtcli.device.change.own_journal import OwnJournal
    from dvtcli.device.node import Node
    from dvtcli.domain.network.network_plan import NodePlan
    from dvtcli.operations.results import Stored
    from dvtcli.operations.session import Session
    from dvtcli.operations.take_back_network import Course


def store_network(
    session: Session, course: Course, planned: Sequence[NodePlan], prove: str | None
) -> tuple[Stored, ...]:
    """Store what *planned* say, one node after the other; LeftChanged names who has stored and who has not.

    What was set stays on every node, verified; a journal says from here on that stores have begun.
    """
    stores = [Storing(one.node_id, one.store) for one in planned]
    try:
        return store_each(session, course.name, stores, course.nodes, course.journals(), prove)
    except LeftChanged:
        for journal in course.journals():
            journal.complete_whole()
        course.end()
        raise


def store_each(
    session: Session,
    name: str,
    stores: Sequence[Storing],
    nodes: Mapping[int, Node],
    journals: Sequence[OwnJournal],
    prove: str | None = None,
) -> tuple[Stored, ...]:
    """Carry out those of *stores* that are not done, the end of what is called *name*; *journals* say how far it is.

    LeftChanged names who has stored and who has not.
    """
    answers: dict[int, Stored] = {}
    failed: dict[int, BaseException] = {}
    states = {one.node_id: one for one in stores}

    def store(one: Storing) -> None:
        for journal in journals:
            journal.final(_final(name, states.values(), one), tuple(states.values()))
        node = nodes[one.node_id]
        node.pending.stores += 1  # whatever becomes of it, no script takes its lines back any more
        try:
            answers[one.node_id] = store_settings(session, node, store_group(one.group), prove=prove)
        except (DvtcliError, KeyboardInterrupt) as fault:
            failed[one.node_id] = fault
            raise
        states[one.node_id] = replace(one, is_done=True)

    jobs = [partial(store, one) for one in stores if not one.is_done]
    faults = one_by_one(jobs)  # not side by side: wherever this ends, nobody knows of one node at most
    if failed:
        raise _not_all(states.values(), failed) from next(iter(failed.values()))
    if faults:
        raise faults[0]
    return tuple(answers[one.node_id] for one in stores if one.node_id in answers)


def _final(name: str, states: Iterable[Storing], one: Storing) -> str:
    """What a `recover` says had begun, where this process ends in the middle of it."""
    done = [str(before.node_id) for before in states if before.is_done]
    stored = f"; stored on node {', '.join(done)}" if done else ""
    return f"{name}: store on node {one.node_id}{stored}"


def _not_all(states: Iterable[Storing], failed: Mapping[int, BaseException]) -> LeftChanged:
    """What is told where the stores of *failed* came to nothing; nobody knows of those that gave no answer."""
    first, fault = next(iter(failed.items()))
    done = [one.node_id for one in states if one.is_done]
    unsure = [node_id for node_id, one in failed.items() if _is_unsure(one)]
    missing = [one.node_id for one in states if one.node_id not in {*done, *unsure}]
    left = LeftChanged(
        f"every node holds what was planned, and node {first} did not store it",
        node=first,
        place=fault.place if isinstance(fault, DvtcliError) else None,
        why=str(fault) or "interrupted",
        hint=f"`-n {first} store` finishes, on each of them; `undo --all` goes back to what was before, then "
        "`store` on each that stored",
        state="left_changed",
    )
    rows = (("stored", done), ("not stored", missing), ("unknown", unsure))
    left.details += [(label, f"node {', '.join(map(str, numbers))}") for label, numbers in rows if numbers]
    left.state_text = "every node holds what was planned, read back equal; not all of them have stored it"
    return left


def _is_unsure(fault: BaseException) -> bool:
    """Whether nobody knows if the node stored."""
    if not isinstance(fault, DvtcliError):
        return True
    return isinstance(fault, NoAnswer | SdoProtocolError) or fault.state == "unknown"

"""Storing on the nodes of a network, once all of them are verified: from the first store on nothing is taken back.

Does not know what was changed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.change.whole import Storing
from dvtcli.errors import DvtcliError, LeftChanged, NoAnswer, SdoProtocolError
from dvtcli.operations.store_restore import store_settings

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dvtcli.device.change.own_journal import OwnJournal
    from dvtcli.device.node import Node
    from dvtcli.domain.network.network_plan import NodePlan
    from dvtcli.operations.results import Stored
    from dvtcli.operations.session import Session
    from dvtcli.operations.take_back_network import Course

#: Words of `store` as sub-indices of 0x1010; `all` is whatever the device means by a store.
_GROUPS = {"all": None, "communication": 2, "application": 3}


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
    answers: list[Stored] = []
    states = list(stores)
    for number, one in enumerate(stores):
        if one.is_done:
            continue
        for journal in journals:
            journal.final(_final(name, states, one), tuple(states))
        node = nodes[one.node_id]
        node.pending.stores += 1  # whatever becomes of it, no script takes its lines back any more
        group = _GROUPS[one.group] if one.group in _GROUPS else int(one.group)
        try:
            answers.append(store_settings(session, node, group, prove=prove))
        except (DvtcliError, KeyboardInterrupt) as failed:
            raise _not_all(states, one, failed) from failed
        states[number] = replace(one, is_done=True)
    return tuple(answers)


def _final(name: str, states: Sequence[Storing], one: Storing) -> str:
    """What a `recover` says had begun, where this process ends in the middle of it."""
    done = [str(before.node_id) for before in states if before.is_done]
    stored = f"; stored on node {', '.join(done)}" if done else ""
    return f"{name}: store on node {one.node_id}{stored}"


def _not_all(states: Sequence[Storing], one: Storing, failed: BaseException) -> LeftChanged:
    behind = [other.node_id for other in states if not other.is_done and other is not one]
    unsure = not isinstance(failed, DvtcliError) or isinstance(failed, NoAnswer | SdoProtocolError)
    unsure = unsure or (isinstance(failed, DvtcliError) and failed.state == "unknown")
    missing = behind if unsure else [one.node_id, *behind]
    left = LeftChanged(
        f"every node holds what was planned, and node {one.node_id} did not store it",
        node=one.node_id,
        place=failed.place if isinstance(failed, DvtcliError) else None,
        why=str(failed) or "interrupted",
        hint=f"`-n {one.node_id} store` finishes, on each of them; `undo --all` goes back to what was before, then "
        "`store` on each that stored",
        state="left_changed",
    )
    rows = (
        ("stored", [other.node_id for other in states if other.is_done]),
        ("not stored", missing),
        ("unknown", [one.node_id] * unsure),
    )
    left.details += [(label, f"node {', '.join(map(str, numbers))}") for label, numbers in rows if numbers]
    left.state_text = "every node holds what was planned, read back equal; not all of them have stored it"
    return left

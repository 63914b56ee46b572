"""Storing on the nodes of a network, once all of them are verified: from the first store on nothing is taken back.

Does not know what was changed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.errors import DvtcliError, LeftChanged, NoAnswer, SdoProtocolError
from dvtcli.operations.store_restore import store_settings

if TYPE_CHECKING:
    from collections.abc import Sequence

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
    done: list[Stored] = []
    for one in planned:
        for journal in course.journals():
            journal.final(_final(course.name, done, one))
        course.nodes[one.node_id].pending.stores += 1  # whatever becomes of it, no script takes its lines back any more
        group = _GROUPS[one.store] if one.store in _GROUPS else int(one.store)
        try:
            done.append(store_settings(session, course.nodes[one.node_id], group, prove=prove))
        except (DvtcliError, KeyboardInterrupt) as failed:
            for journal in course.journals():
                journal.complete_whole()
            course.end()
            raise _not_all(planned, done, one, failed) from failed
    return tuple(done)


def _final(name: str, done: Sequence[Stored], one: NodePlan) -> str:
    """What a `recover` says had begun, where this process ends in the middle of it."""
    stored = f"; stored on node {', '.join(str(before.node) for before in done)}" if done else ""
    return f"{name}: store on node {one.node_id}{stored}"


def _not_all(planned: Sequence[NodePlan], done: Sequence[Stored], one: NodePlan, failed: BaseException) -> LeftChanged:
    ids = [other.node_id for other in planned]
    behind = ids[ids.index(one.node_id) + 1 :]
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
    rows = (("stored", [other.node for other in done]), ("not stored", missing), ("unknown", [one.node_id] * unsure))
    left.details += [(label, f"node {', '.join(map(str, numbers))}") for label, numbers in rows if numbers]
    left.state_text = "every node holds what was planned, read back equal; not all of them have stored it"
    return left

"""The error of a node that does not answer, whichever way it was asked."""

from __future__ import annotations

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import NoAnswer, SafetyRefusal, stopped_node

_NEVER = Hint(Action.FIND_NODES, why="power, node-ID, bit rate? A node in STOPPED answers no SDO; {} shows who does")
_BEFORE = Hint(
    Action.GIVE_TIMEOUT,
    why="it answered before, and one lost frame is enough for this: try again; where that repeats, a longer {}, "
    "or look at its supply, the wiring and the bus load",
)


def no_answer(
    node_id: int,
    place: str,
    timeout_s: float,
    why: str | None = None,
    *,
    answered: bool = False,
    is_stopped: bool = False,
) -> NoAnswer:
    """Node *node_id* did not answer for the object at *place* (`1018:01`) within *timeout_s* (s).

    *answered* says whether it ever did before, *is_stopped* whether it was heard to be STOPPED.
    """
    if is_stopped:
        refused, silent = stopped_node(node_id), f"it did not answer for 0x{place} within {timeout_s:g} s"
        stopped = NoAnswer(refused.text, node=node_id, place=place, why=silent, hint=refused.hint)
        stopped.exit_code, stopped.slug = SafetyRefusal.exit_code, SafetyRefusal.slug  # CiA 301, 7.3.2.2: no SDO then
        return stopped
    return NoAnswer(
        f"node {node_id} did not answer for 0x{place} within {timeout_s:g} s",
        node=node_id,
        place=place,
        why=why,
        hint=_BEFORE if answered else _NEVER,
    )

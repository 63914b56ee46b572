"""In which order nodes take new node-IDs so that no two ever have one: also where they swap. Sends nothing."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import SafetyRefusal
from dvtcli.operations.results.lss_nodes import LssGiven

#: the node-IDs that a node may have for the time being, the best first: low ones are of masters and of first machines
_FOR_THE_TIME_BEING = range(126, 0, -1)


def in_order(given: Sequence[LssGiven], used: Collection[int], kept: Collection[int]) -> list[LssGiven]:
    """The steps by which each of *given* gets its node-ID, each to one that nobody has by then.

    *used* are the node-IDs that somebody has now, *kept* those that nobody may take for the time being, besides.
    Where nodes stand in each other's way one of them takes another node-ID for the time being; SafetyRefusal where none
    is free, or where a node-ID is of somebody who does not move.
    """
    left, taken, steps = list(given), set(used), []
    wanted = {slave.node_id for slave in given} | set(kept)
    while left:
        free = next((slave for slave in left if slave.node_id not in taken), None)
        if free is None:
            free = _aside(left, taken | wanted)
            left[left.index(_of(left, free))] = replace(_of(left, free), before=free.node_id)
        else:
            left.remove(free)
        taken = taken - {free.before} | {free.node_id}
        steps.append(free)
    return steps


def _aside(left: Sequence[LssGiven], not_free: Collection[int]) -> LssGiven:
    """The step that lets one of *left* make room for another one."""
    one = next((slave for slave in left if any(other.node_id == slave.before for other in left)), None)
    node_id = next((node_id for node_id in _FOR_THE_TIME_BEING if node_id not in not_free), None)
    if one is None or node_id is None:
        raise SafetyRefusal(
            f"node-ID {left[0].node_id} is in use" if one is None else "no node-ID is free to swap others with",
            hint=Hint(Action.FIND_NODES, why="shows who is there"),
        )
    return replace(one, node_id=node_id)


def _of(left: Sequence[LssGiven], step: LssGiven) -> LssGiven:
    return next(slave for slave in left if slave.address == step.address)

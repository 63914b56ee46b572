"""Run a line for each of several nodes, one after another."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from dvtcli.cli.boundary import SIGNALLED, exit_code_of
from dvtcli.cli.view.lines import Cell
from dvtcli.errors import (
    DeviceRefused,
    DvtcliError,
    LeftChanged,
    NoAnswer,
    Restarted,
    SdoAborted,
    SdoProtocolError,
)

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.object_params import ObjectWord
    from dvtcli.operations.session.session import SessionNodes

#: makes the final error from all node-IDs and the outcomes (answers or errors) of nodes that ran
Ending = Callable[[Sequence[int], Mapping[int, Any]], DvtcliError | None]
#: faults that concern a single node
_OF_A_NODE = (DeviceRefused, NoAnswer, Restarted, SdoAborted, SdoProtocolError)


def several_ids(session: SessionNodes) -> tuple[int, ...]:
    """Return the nodes of -n; `all` means the simulated nodes, else the nodes found on the bus.

    The search runs once per session: a second search could miss a slow node and skip it silently. Nodes received since
    are added. Raises NoAnswer if none is found.
    """
    if not session.base.every_node:
        return session.base.nodes
    from dvtcli.operations.nodes.find_nodes import find_nodes

    network = session.network
    if network.simulated_ids:
        return network.simulated_ids
    if not network.scanned:
        find_nodes(session)  # which notes them
    found = tuple(sorted({*network.scanned, *network.bus.nodes_seen()}))
    if not found:
        raise NoAnswer("no node was found", hint="`scan` searches again; check that this is the right bus")
    return found


def selected_nodes(session: SessionNodes) -> tuple[int | None, ...]:
    """Return the nodes of -n if several and none was selected since; else None for the selected node."""
    base = session.base
    several = base.every_node or len(base.nodes) > 1
    return several_ids(session) if several and session.selected is None else (None,)


def selected_objects(session: SessionNodes, words: Sequence[ObjectWord]) -> list[tuple[str, int | None]]:
    """Return each object with its node; an object without a node is repeated for each node of -n."""
    nodes = selected_nodes(session) if words else ()
    return [(word.text, node) for word in words for node in ((word.node_id,) if word.node_id is not None else nodes)]


def on_each_node(
    session: Conversation,
    run: Callable[[], Any],
    deliver: Callable[[Any], Any],
    *,
    go_on: bool,
    ahead: Callable[[Sequence[int]], None] | None = None,
    ending: Ending | None = None,
) -> int:
    """Call *run* with each node of -n selected, and *deliver* its answer; returns the first failure's exit code.

    Exit code 7 takes precedence. A failing node ends the line, except with *go_on*, or with *ending* if the node
    refuses or does not answer. *ahead* checks all nodes before the first; *ending* makes an error from all outcomes
    after a failure.
    """
    codes: list[int] = []
    outcomes: dict[int, Any] = {}
    node_ids = several_ids(session)
    if ahead is not None and (code := exit_code_of(session, partial(ahead, node_ids))):
        return code

    def turn(node_id: int) -> Any:
        try:
            if session.cancellation.requested:  # asked for while the last node was written, whose change is complete
                raise KeyboardInterrupt
            outcomes[node_id] = run()
        except BaseException as fault:
            outcomes[node_id] = fault
            raise
        return deliver(outcomes[node_id])

    try:
        for node_id in node_ids:
            session.selected = node_id
            if not session.output.json:
                session.output.said([[Cell(f"node {node_id}", "bold")]], error=False)
            code = exit_code_of(session, partial(turn, node_id))
            codes += [code] if code else []
            if code in SIGNALLED or (code and not (go_on or (ending is not None and _is_of_node(outcomes[node_id])))):
                break
    finally:
        session.selected = None
    if codes and ending is not None and (told := ending(node_ids, outcomes)) is not None:
        codes.append(exit_code_of(session, partial(_fail, told)))
    return LeftChanged.exit_code if LeftChanged.exit_code in codes else codes[0] if codes else 0


def _is_of_node(outcome: Any) -> bool:
    """Whether *outcome* is an answer, or a fault of its node alone."""
    return not isinstance(outcome, BaseException) or isinstance(outcome, _OF_A_NODE)


def _fail(error: DvtcliError) -> None:
    raise error

"""A line that is done for each of several nodes, one after the other. Does not know what it does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from dvtcli.cli.boundary import SIGNALLED, guarded
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
    from dvtcli.operations.session.session import Session

#: what is told in the end of all nodes that were meant, of which each that had its turn answered, or failed with
Ending = Callable[[Sequence[int], Mapping[int, Any]], DvtcliError | None]
#: what one node comes to without anybody else
_OF_A_NODE = (DeviceRefused, NoAnswer, Restarted, SdoAborted, SdoProtocolError)


def several_ids(session: Session) -> tuple[int, ...]:
    """The nodes that -n names where it names several; `all` are those that are simulated, else those that are found.

    They are looked for once: a line that asked anew might miss one that is slow for once, and call it done. Who is
    heard since is one of them.
    """
    if not session.base.every_node:
        return session.base.nodes
    from dvtcli.operations.nodes.find_nodes import find_nodes

    network = session.network
    if network.simulated_ids:
        return network.simulated_ids
    if not network.scanned:
        find_nodes(session)  # which notes them
    found = tuple(sorted({*network.scanned, *network.bus.heard_nodes()}))
    if not found:
        raise NoAnswer("no node was found: nothing was done", hint="`scan` looks again; is the bus the right one?")
    return found


def nodes_meant(session: Session) -> tuple[int | None, ...]:
    """The nodes that -n names where it names several and none was selected since; else None, the selected one."""
    base = session.base
    several = base.every_node or len(base.nodes) > 1
    return several_ids(session) if several and session.selected is None else (None,)


def objects_meant(session: Session, words: Sequence[ObjectWord]) -> list[tuple[str, int | None]]:
    """Each object with its node; one that names none is meant of each node that -n names."""
    nodes = nodes_meant(session) if words else ()
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
    """Do *run* with each node that -n names selected, and *deliver* its answer; the exit code of the first that failed.

    It is 7 if any has that. With *go_on* a node that fails keeps no other from its turn, with *ending* one that
    refuses, or does not answer. *ahead* looks at all of them before the first; *ending* makes an error of what became
    of all of them if one failed.
    """
    codes: list[int] = []
    outcomes: dict[int, Any] = {}
    node_ids = several_ids(session)
    if ahead is not None and (code := guarded(session, partial(ahead, node_ids))):
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
            code = guarded(session, partial(turn, node_id))
            codes += [code] if code else []
            if code in SIGNALLED or (code and not (go_on or (ending is not None and _is_of_node(outcomes[node_id])))):
                break
    finally:
        session.selected = None
    if codes and ending is not None and (told := ending(node_ids, outcomes)) is not None:
        codes.append(guarded(session, partial(_fail, told)))
    return LeftChanged.exit_code if LeftChanged.exit_code in codes else codes[0] if codes else 0


def _is_of_node(outcome: Any) -> bool:
    """Whether *outcome* is an answer, or a fault of its node alone."""
    return not isinstance(outcome, BaseException) or isinstance(outcome, _OF_A_NODE)


def _fail(error: DvtcliError) -> None:
    raise error

"""A line that is done for each of several nodes, one after the other. Does not know what it does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from dvtcli.cli.boundary import SIGNALLED, guarded
from dvtcli.cli.view.lines import Cell
from dvtcli.errors import LeftChanged, NoAnswer

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.object_params import ObjectWord
    from dvtcli.operations.session.session import Session


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
    return [(word.text, one) for word in words for one in ((word.node_id,) if word.node_id is not None else nodes)]


def on_each_node(session: Conversation, run: Callable[[], Any], *, go_on: bool) -> int:
    """Do *run* with each node that -n names selected; the exit code of the first that failed, or 7.

    With *go_on* a node that fails keeps no other from its turn.
    """
    codes: list[int] = []
    try:
        for node_id in several_ids(session):
            session.selected = node_id
            if not session.output.json:
                session.output.said([[Cell(f"node {node_id}", "bold")]], error=False)
            code = guarded(session, run)
            codes += [code] if code else []
            if code in SIGNALLED or (code and not go_on):
                break
    finally:
        session.selected = None
    return LeftChanged.exit_code if LeftChanged.exit_code in codes else codes[0] if codes else 0

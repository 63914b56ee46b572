"""Choose the nodes for a device's file: `-n`, else the file's node-ID. Reads no node and no file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.operations.session.session_nodes import SessionNodes
    from dvtcli.operations.whole_device.held_device import HeldDevice


def selected_nodes(session: SessionNodes) -> tuple[int, ...]:
    """Return the selected node or the nodes of `-n`; empty if none. Raises UsageError for `-n all`."""
    if session.selected is None and session.base.every_node:
        raise UsageError(
            "a file about one device is for nodes that are named",
            given={"node_id": "all"},
            hint=Hint(Action.GIVE, {"node_id": "3,4,5"}, "names several"),
        )
    if session.selected is None and len(session.base.nodes) > 1:
        return session.base.nodes
    selected = session.selected_id()
    return () if selected is None else (selected,)


def node_of_file(session: SessionNodes, held: HeldDevice) -> int:
    """Return the node-ID of *held*, with a message; raises UsageError if it has none."""
    if held.node_id is None:
        return session.node_id()
    session.tell.note(f"node {held.node_id}, as {held.name} says")
    return held.node_id


def selected_alone(session: SessionNodes, held: HeldDevice) -> tuple[int, ...]:
    """Return `selected_nodes`; raises UsageError if none, as *held* may be of another device."""
    if found := selected_nodes(session):
        return found
    own = "" if held.node_id is None else f" ({held.name} was made of node {held.node_id})"
    raise UsageError(
        "no node is selected",
        place=held.name,
        hint=Hint(
            Action.GIVE, {"node_id": f"ID{own}"}, "this writes to the device that takes the other one's place: {}"
        )
        + Hint(Action.SHOW_NODE, {"node": "ID"}, ", or {}"),
    )

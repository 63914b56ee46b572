"""Require a device's identity or state; later lines are not run on another device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_identity
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import SafetyRefusal
from dvtcli.operations.results import Facts

if TYPE_CHECKING:
    from dvtcli.operations.session.session_nodes import SessionNodes

#: sub-indices of 0x1018, the identity object
_SUB_INDICES = {"vendor": 1, "product": 2, "revision": 3, "serial": 4}


def require_identity(
    session: SessionNodes, wanted: Sequence[tuple[str, int]], node_id: int | None = None, who: str = "the script"
) -> Facts:
    """Compare the identity (0x1018) of a node (None: the selected node) with *wanted*.

    *wanted* has pairs of `vendor`, `product`, `revision` or `serial` and a number. Raises SafetyRefusal, naming *who*
    wants another device, if a number differs.
    """
    node = session.node(node_id)
    held = {name: read_identity(node.sdo, sub_index) for name, sub_index in _SUB_INDICES.items()}
    for name, value in wanted:
        if held[name] != value:
            has = "none" if held[name] is None else f"0x{held[name]:08X}"
            raise SafetyRefusal(
                f"node {node.node_id} is another device: {name} is {has}, {who} wants 0x{value:08X}",
                node=node.node_id,
                place=f"1018:{_SUB_INDICES[name]:02X}",
                hint=Hint(Action.FIND_NODES, why="is this the right node? {} lists them"),
            )
    shown = ", ".join(f"{name} 0x{value:08X}" for name, value in wanted)
    return Facts("require", (("node", node.node_id), ("identity", held)), (f"node {node.node_id} is the one: {shown}",))


def require_power_off(session: SessionNodes, node_id: int | None = None) -> Facts:
    """Raises SafetyRefusal if a statusword of a node (None: the selected node) shows an enabled power stage."""
    from dvtcli.operations.session.consent import refuse_powered

    node = session.node(node_id)
    refuse_powered(session, [node.node_id])
    rows = (("node", node.node_id), ("power_off", True))
    return Facts("require", rows, (f"no statusword of node {node.node_id} says that its power stage is on",))

"""Read a plan for a network, saved by `plan -o` (`dvtcli.plan/1`).

Checks every part: the file may be edited by hand.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from dvtcli.device.change.plan_document import MOST_CHANGES, read_change, read_number, read_plan, read_plan_identity
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.network_plan import LeftOut, NetworkPlan, NodePlan
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, PdoChange, Plan, ValueChange
from dvtcli.errors import InputFileError
from dvtcli.files.input_file import read_input, read_input_head

SCHEMA = "dvtcli.plan/1"
_STORES = ("all", "communication", "application")


def is_network_plan(path: Path) -> bool:
    """Whether *path* is a saved plan, by its first character. Raises OSError if unreadable."""
    return read_input_head(path, 64).lstrip().startswith(b"{")


def read_network_plan(path: Path) -> NetworkPlan:
    """Read the plan in *path*. Raises InputFileError if malformed, OSError if unreadable."""
    from dvtcli.device.change.journal import MOST_BYTES

    data = read_input(path, 127 * MOST_BYTES, "plan")
    try:
        document = json.loads(data)
        if not isinstance(document, dict) or document.get("schema") != SCHEMA:
            raise ValueError(f"it does not say {SCHEMA}")
        nodes = document.get("nodes")
        if not isinstance(nodes, list):
            raise ValueError("it names no nodes")
        planned = tuple(sorted(map(_node, nodes), key=lambda plan: plan.node_id))
        if len({plan.node_id for plan in planned}) != len(planned):
            raise ValueError("a node occurs twice")
        return NetworkPlan(str(document.get("file", path)), planned, document.get("sync_master") is True)
    except (ValueError, RecursionError) as wrong:
        raise InputFileError(
            f"{path} is not a usable plan",
            place=str(path),
            why=str(wrong),
            hint=Hint(Action.SAVE_PLAN, why="writes a new one"),
        ) from wrong


def _node(document: Any) -> NodePlan:
    if not isinstance(document, dict):
        raise ValueError("a node is malformed")
    store = document.get("store") or ""
    if store not in _STORES and store:
        read_number({"store": int(str(store))}, "store", 127, least=1)
    name, unstored = str(document.get("name", "")), document.get("unstored", [])
    if not isinstance(unstored, list):
        raise ValueError("what is not stored is malformed")
    node_id = read_number(document, "node", 127, least=1)
    if document.get("changes") == []:  # who it is counts all the same: it may store
        identity, plan = read_plan_identity(document), Plan(node_id, ())
    else:
        identity, plan = read_plan(document)
    wanted, values = _wanted([*_holds(document, "holds"), *plan.changes])
    _, compared_values = _wanted(_holds({"also_holds": [], **document}, "also_holds"))
    return NodePlan(
        name, plan, identity, store=str(store), wanted=wanted, values=values, unstored=tuple(map(str, unstored)),
        is_read=document.get("read") is not False, needs_power_off=document.get("power_off") is True,
        doubt=str(document.get("doubt") or ""), left_out=tuple(map(_left_out, document.get("left_out") or ())),
        also_equal=read_number({"also_equal": 0, **document}, "also_equal", MOST_CHANGES),
        compared_values=compared_values,
    )  # fmt: skip


def _left_out(document: Any) -> LeftOut:
    """Return the parts of the network file that the plan does not write."""
    if not isinstance(document, dict):
        raise ValueError("what is left out is malformed")
    held, said = (bytes.fromhex(str(document.get(key) or "")) or None for key in ("before", "after"))
    place, why = str(document.get("object", "")), str(document.get("why", ""))
    return LeftOut(place, why, document.get("remains") is True, held, said)


def _holds(document: dict[str, Any], key: str) -> list[Change]:
    """Return values already as wanted when the plan was made, by *key* of the *document*."""
    holds = document.get(key)
    if not isinstance(holds, list) or len(holds) > MOST_CHANGES:
        raise ValueError("it does not say what is not to be changed")
    return list(map(read_change, holds))


def _wanted(changes: list[Change]) -> tuple[dict[Pdo, PdoConfig], dict[tuple[int, int], bytes]]:
    """Return the target of every PDO and every single object in *changes*."""
    pdos = {change.pdo: change.after for change in changes if isinstance(change, PdoChange)}
    steps = [change.step for change in changes if isinstance(change, ValueChange)]
    return pdos, {(step.index, step.sub_index): step.after for step in steps}

"""What a node holds, as a network file that says the same. Writes nothing to a node."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.network.wanted_state import NetworkWish
from dvtcli.domain.several import plural
from dvtcli.errors import UsageError
from dvtcli.files.network.write_network import write_network
from dvtcli.operations.exchange.exported_node import exported_node
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.operations.session.session import Session

SUFFIXES = (".yaml", ".yml")


def export_node(session: Session, file: str, node_id: int | None = None) -> Facts:
    """Write every PDO of the node with *node_id* (None: the selected one), as it is now, to the network file *file*.

    Asks before it overwrites. What is no whole PDO, or an MPDO, is left out and said. UsageError for another suffix,
    where no node is selected, or the file cannot be written.
    """
    path = network_place(file, "NAME.yaml")
    if node_id is None and session.selected_id() is None:
        hint = (
            Hint(Action.GIVE, {"node_id": "ID"}, "names it")
            + Hint(Action.SHOW_NODE, {"node": "ID"}, ", or {}")
            + Hint(Action.IMPORT, {"file": file}, "writes all nodes of the network")
        )
        raise UsageError("export writes one node to a network file, and none is selected", hint=hint)
    node = session.node(node_id)
    found = exported_node(session, node, node.pdos(), path)
    ask_before_overwriting(session, path)
    make_file(session, path, write_network(NetworkWish((found.wish,)), f"What node {node.node_id} held", found.remarks))
    count = len(found.wish.pdos)
    counted = f"{verbatim(file)}: node {node.node_id}, {plural(count, 'PDO')}"
    said: list[Hint | str] = [Hint(Action.CHECK, {"file": file}, f"{counted}. Check it: {{}}")]
    if note := found.left_out_note:
        said.append(f"note: {note}")
    if others := [str(known_id) for known_id in session.known_ids() if known_id != node.node_id]:
        said.append(
            Hint(Action.GIVE, {"node_id": others[0]}, f"This is node {node.node_id} only: {{}} exports another")
            + Hint(Action.IMPORT, {"file": "FILE.yaml"}, ", {} all nodes.")
        )
    rows = (("file", file), ("node", node.node_id), ("pdos", count), ("left_out", list(found.left_out)))
    return Facts("export", rows, tuple(said))


def network_place(file: str, example: str) -> Path:
    """Where the network file *file* is to be; UsageError for another suffix, or where it cannot be."""
    if not file.lower().endswith(SUFFIXES):
        hint = Hint(Action.EXPORT, {"file": "FILE.dcf"}, "writes a DCF") + Hint(
            Action.SAVE_SCRIPT, {"all": True}, ", {} a script"
        )
        raise UsageError(f"{file}: a network file ends in .yaml", hint=hint)
    return place_of(file, example)

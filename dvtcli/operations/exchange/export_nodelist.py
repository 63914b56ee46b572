"""A whole network as a nodelist (CiA 306-3), with a DCF of each node beside it. Writes nothing to a node."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.several import join_some, plural
from dvtcli.errors import NoAnswer, UsageError
from dvtcli.files.eds.writer import eds_bytes
from dvtcli.files.nodelist import ListedNode, Nodelist, nodelist_text
from dvtcli.operations.nodes.find_nodes import find_nodes
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of
from dvtcli.operations.whole_device.export_dcf import export_dcf

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.operations.session.session import Session


def export_nodelist(session: Session, file: str, *, twice: bool = False) -> Facts:
    """Write the nodes that answer (or those of `-n`) to the nodelist *file*, and a DCF of each into its folder.

    A node that no EDS describes is listed without one, and said. Asks before it overwrites any of them. With *twice*
    each object is read a second time. NoAnswer where no node answers; else as `export_dcf`.
    """
    path = place_of(file, "nodelist.cpj")
    ask_before_overwriting(session, path)
    notes: list[str] = []
    ids = session.base.nodes or tuple(row.node for row in find_nodes(session).rows if not row.note)
    if not ids:
        raise NoAnswer(
            "no node answers",
            hint=Hint(Action.CHECK_SETUP, why="look at bit rate and supply: {}") + Hint(Action.FIND_NODES, why=", {}"),
        )
    said: list[str] = []
    nodes = [_listed(session, path, node_id, notes, said, twice=twice) for node_id in sorted(ids)]
    untold = [str(node.node_id) for node in nodes if not node.dcf]
    if len(untold) == len(nodes):
        raise UsageError(
            f"no node that answers has an EDS here ({join_some(untold)}): "
            "a nodelist without a DCF says nothing of them",
            hint=Hint(Action.ADD_EDS, why="keeps one for every node of its kind, then export again"),
        )
    if untold:
        why = f"node {', '.join(untold)}: no EDS is known, so no DCF; add one to the library, then export again"
        notes.insert(0, why)
        said.insert(0, why)
    make_file(session, path, eds_bytes(nodelist_text(Nodelist(path.parent.resolve().name, tuple(nodes)))))
    rows = (
        ("file", file),
        ("nodes", [{"node": node.node_id, "name": node.name, "dcf": node.dcf or None} for node in nodes]),
        ("notes", notes),
    )  # fmt: skip
    dcfs = sum(bool(node.dcf) for node in nodes)
    first = f"{file}: {plural(len(nodes), 'node')}, {plural(dcfs, 'DCF')} beside it"
    return Facts("nodelist", rows, (first, *(f"note: {note}" for note in said)))


def _listed(
    session: Session, path: Path, node_id: int, notes: list[str], said: list[str], *, twice: bool
) -> ListedNode:
    """The node, with its DCF written; what is left out is in *notes*, each object, and the first of them in *said*."""
    node = session.node(node_id)
    if node.dictionary is None:
        return ListedNode(node_id, node.title)
    name = f"node{node_id}.dcf"
    done = dict(export_dcf(session, str(path.with_name(name)), node_id, twice=twice).rows)
    left_out = [f"{entry['object']} left out: {entry['why']}" for entry in done["left_out"]]
    notes += (f"node {node_id}: {line}" for line in left_out)
    if left_out:
        said.append(f"node {node_id}: {join_some(left_out)}")
    return ListedNode(node_id, node.title, name)

"""Export a node as a network file. Writes nothing to the node."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.network.wanted_state import FileWord, NetworkWish
from dvtcli.domain.text import plural
from dvtcli.errors import UsageError
from dvtcli.files.device_library.stored_files import stored_path
from dvtcli.files.network.write_network import write_network
from dvtcli.operations.exchange.exported_objects import all_of
from dvtcli.operations.exchange.exported_pdos import Exported, exported
from dvtcli.operations.opening.simulated_nodes import file_or_family
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of
from dvtcli.simulator.network.family_file import family_of

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.operations.session.session_nodes import SessionNodes


def exported_node(session: SessionNodes, node: ReadableNode, held: Mapping[Pdo, PdoConfig], path: Path) -> Exported:
    """Export *node* with the PDOs *held* to the network file *path*.

    The file always names the EDS: its identity may lead to another file later, when one is added to the library.
    """
    found = exported(node, held, node.memory, all_of(node.dictionary))
    dcf, modules = _dcf(session, node, path), _modules(session, node)
    return replace(found, wish=replace(found.wish, dcf=dcf, modules=modules, profile=session.options.profile))


def _modules(session: SessionNodes, node: NodeDescription) -> tuple[int, ...] | None:
    """Return the connected modules of *node*, None if its EDS is of no modular device, or says them itself."""
    files = session.network.files
    path = files.eds_path(node.node_id)
    return None if path is None else files.modules(node.node_id, path)


def _dcf(session: SessionNodes, node: NodeDescription, path: Path) -> FileWord | None:
    """Return the path, for *path*, of the EDS of *node*; None if it has none."""
    if session.options.eds is not None:
        return eds_word(file_or_family(session.options.eds), path)
    eds = session.network.files.eds_path(node.node_id)
    return None if eds is None else eds_word(eds, path)


def eds_word(eds: Path, path: Path) -> FileWord:
    """Name *eds* in the network file *path*: as a family, a library file, or a path."""
    family = family_of(eds)
    if family is not None:
        return FileWord(family)
    return FileWord(eds.name) if stored_path(eds.name) == eds else beside(eds, path)


def beside(eds: Path, path: Path) -> FileWord:
    """Return the path of *eds* relative to the network file *path*."""
    try:
        return FileWord(Path(os.path.relpath(eds, path.parent)).as_posix())
    except ValueError:  # on another drive
        return FileWord(eds.absolute().as_posix())


SUFFIXES = (".yaml", ".yml")


def export_node(session: SessionNodes, file: str, node_id: int | None = None) -> Facts:
    """Export every PDO of the node with *node_id* (None: the selected node) to the network file *file*.

    Asks before overwriting. Incomplete PDOs and MPDOs are left out and reported. Raises UsageError for another suffix,
    if no node is selected, or the file cannot be written.
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
    """Return the path of the network file *file*; raises UsageError for another suffix or a bad place."""
    if not file.lower().endswith(SUFFIXES):
        hint = Hint(Action.EXPORT, {"file": "FILE.dcf"}, "writes a DCF") + Hint(
            Action.SAVE_SCRIPT, {"all": True}, ", {} a script"
        )
        raise UsageError(f"{file}: a network file ends in .yaml", hint=hint)
    return place_of(file, example)

"""A network as it is, or as a folder of EDS files has it, as a network file. Writes nothing to a node."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import DvtcliError, NoAnswer, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.exchange.export_network import network_place
from dvtcli.operations.exchange.exported_node import exported_node
from dvtcli.operations.exchange.exported_objects import all_of
from dvtcli.operations.exchange.exported_pdos import exported
from dvtcli.operations.exchange.nodes_of_files import nodes_of_files
from dvtcli.operations.exchange.written_network import FoundNode, write_found
from dvtcli.operations.nodes.find_nodes import find_nodes
from dvtcli.operations.session.save_script import ask_before_overwriting
from dvtcli.operations.wanted.unknown_bit_rate import tell_unknown_bit_rate

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.ports import SdoReader
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


def import_network(session: Session, file: str, folder: str | None = None, manager: int | None = None) -> Facts:
    """Write the nodes that answer, and what joins them, to the network file *file*: a scan, or the nodes of `-n`.

    With *folder* its EDS and DCF files instead, which needs no bus: a DCF's node-ID counts, others are numbered. Of a
    nodelist (CiA 306-3) in it, or as *folder*, its nodes and their DCFs. With *manager* what the node of that node-ID
    downloads to its nodes. Asks before it overwrites. NoAnswer where no node answers, UsageError where there is no such
    file or nothing in it, or both are given.
    """
    if manager is not None:
        from dvtcli.operations.exchange.import_manager import import_manager

        if folder is not None:
            raise UsageError(
                f"{folder} is given, too: the file is made of one of them", given={"from_manager": manager}
            )
        return import_manager(session, file, manager)
    path = network_place(file, "NAME.yaml")
    ask_before_overwriting(session, path)
    notes: list[str] = []
    if folder is None:
        title = f"What the network {session.bus.name} held"
        found = list(_live(session, path, notes))
        if not found:
            raise NoAnswer(
                "no node answers",
                hint=Hint(Action.CHECK_SETUP, why="look at bit rate and supply: {}")
                + Hint(Action.FIND_NODES, why=", {}"),
            )
    else:
        title = f"What the files of {folder} say"
        found = list(nodes_of_files(Path(folder), path, notes))
    notes += (f"node {node.exported.wish.node_id}: {note}" for node in found if (note := node.exported.left_out_note))
    return write_found(session, path, file, title, found, notes)


def _live(session: Session, path: Path, notes: list[str]) -> Iterator[FoundNode]:
    """Every node that answers; one that is there and does not is said."""
    unnamed: list[str] = []
    ids = list(_ids(session, notes))
    tell_unknown_bit_rate(session, len(ids))
    silent = _look_ahead(session, ids)
    for node_id in ids:
        try:
            if node_id in silent:
                raise silent[node_id]
            node = session.node(node_id)
            held = dict(node.known_pdos())
            found = exported_node(session, node, held, path)
        except (NoAnswer, SdoProtocolError, SdoAborted) as failed:
            if session.base.nodes:
                raise
            notes.append(f"node {node_id} is left out: {failed.text}")
            continue
        if node.dictionary is None:
            unnamed.append(str(node_id))
        yield FoundNode(found, held, _memory(node))
    if unnamed:
        who = f"node {', '.join(unnamed)}"
        notes.append(f"{who}: no EDS is known, objects are numbers; add one to the library, then import again")


def _look_ahead(session: Session, ids: Sequence[int]) -> dict[int, DvtcliError]:
    """Read what is exported of the nodes *ids*, side by side where nothing runs; of those that cannot be met, why not.

    Anything else that cannot be read is told where it is needed.
    """
    nodes: list[Node] = []
    silent: dict[int, DvtcliError] = {}
    for node_id in ids:
        try:
            nodes.append(session.node(node_id))
        except (NoAnswer, SdoProtocolError, SdoAborted) as failed:
            silent[node_id] = failed

    def read(node: Node) -> None:
        with suppress(DvtcliError):
            exported(node, node.pdos(), node.memory, all_of(node.dictionary))

    for fault in session.bus.side_by_side([partial(read, node) for node in nodes]):
        raise fault
    return silent


def _memory(node: Node) -> SdoReader:
    return node.memory


def _ids(session: Session, notes: list[str]) -> Iterator[int]:
    if session.base.nodes:
        yield from session.base.nodes
        return
    for row in find_nodes(session).rows:
        if row.note:
            notes.append(f"node {row.node} is left out: {row.note}")
        else:
            yield row.node

"""Comparing what a node holds with what it should: this session's changes, or a file's values."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.change.pending import REBOOT, VERIFY
from dvtcli.device.read_pdos import present_pdos, read_pdo
from dvtcli.device.wish import Wish, unlike
from dvtcli.files.eds.file_as_node import FileValues
from dvtcli.files.eds.reader import read_eds
from dvtcli.operations.look_at_frames import look
from dvtcli.operations.results import Compared

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.operations.session import Session

#: What is compared with where no file is named.
SESSION = "this session's changes"


def compare(
    session: Session, node: Node, wish: Wish, file: str | None = None, *, frame: bool = False, named: bool = False
) -> Compared:
    """One node's answer; looked at again after a frame, since the node was started for that and may have restarted."""
    found = unlike(node, wish)
    frames, note = look(session, node, [pdo for pdo in wish.pdos if pdo.is_tpdo]) if frame else ((), "")
    found = unlike(node, wish) if frame else found
    if file is None:
        _judge(node, wish, differs=bool(found))
    return Compared(
        node.node_id, len(wish.pdos), wish.parameters, found, file or SESSION, frames, note,
        objects=len(wish.values), frame_asked=frame, named=named,
    )  # fmt: skip


def _judge(node: Node, wish: Wish, *, differs: bool) -> None:
    """A difference forbids to store; only a look at everything this session set, without one, allows it again."""
    suspicions = node.pending.suspicions
    if differs:
        suspicions[VERIFY] = "verify found differences to what this session set"
    elif set(node.wanted) <= set(wish.pdos) and set(node.wanted_values) <= set(wish.values):
        suspicions.pop(VERIFY, None)
        suspicions.pop(REBOOT, None)


def dcf_wish(node: Node, file: str) -> Wish:
    """The PDOs as a DCF (or an EDS's defaults) sets them on this node."""
    dictionary = read_eds(Path(file)).dictionary
    values = FileValues(dictionary, node.node_id)
    return Wish({pdo: read_pdo(values, pdo) for pdo in present_pdos(values, dictionary)})

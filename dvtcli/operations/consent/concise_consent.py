"""Consent to what a manager downloads to a node at boot-up (CiA 302-3, 0x1F22). Writes nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.concise_dcf import concise_entries
from dvtcli.domain.text import join_some, plural
from dvtcli.errors import InputFileError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.operations.user.session_user import SessionUser


def consent_to_concise(session: SessionUser, node: NodeDescription, sub_index: int, data: bytes) -> None:
    """Ask before *data* becomes the manager *node*'s download to the node *sub_index*.

    Raises InputFileError as `concise_doubt`.
    """
    doubt = concise_doubt(node, sub_index, data, force=session.options.force)
    session.consent(f"{doubt}; write it?", node.node_id)


def concise_doubt(node: NodeDescription, sub_index: int, data: bytes, *, force: bool) -> str:
    """Warn about *data* as the manager *node*'s download to the node *sub_index*.

    Raises InputFileError if *data* is no valid concise DCF, unless forced: the node would get a part of it.
    """
    try:
        count = plural(len(concise_entries(data)), "value")
    except ValueError as wrong:
        if not force:
            place = f"1F22:{sub_index:02X}"
            raise InputFileError(
                f"node {node.node_id} 0x{place}: that is no concise DCF",
                node=node.node_id,
                place=place,
                why=str(wrong),
                hint=Hint(Action.CONVERT, {"file": "net.yaml", "target": "node5.cdcf"}, "makes one")
                + Hint(Action.FORCE, why="writes it anyway"),
            ) from wrong
        count = f"{len(data)} bytes that are no concise DCF"
    return f"node {node.node_id} ({node.title}) is to download {count} to node {sub_index} whenever that boots"


def concise_doubts(node: NodeDescription, downloads: Mapping[int, bytes], *, force: bool) -> str:
    """Warn about *downloads*, by node-ID, in a single question; empty if there is no doubt."""
    doubts = [concise_doubt(node, node_id, data, force=force) for node_id, data in downloads.items()]
    if len(doubts) < 2:
        return "".join(doubts)
    ids = join_some(map(str, downloads))
    return f"node {node.node_id} ({node.title}) is to download other values to nodes {ids} whenever they boot"

"""Find the EDS of nodes for which the network file names none, by their identity (0x1018).

Reads the identity only.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError
from dvtcli.operations.network.described_network import DeviceWord, simulated_word
from dvtcli.operations.wanted.identify_nodes import identify_nodes, is_wanted
from dvtcli.simulator.network.family_file import family_of

if TYPE_CHECKING:
    from dvtcli.domain.network.wanted_state import NetworkWish, NodeWish
    from dvtcli.operations.session.session_nodes import SessionNodes


def words_on_bus(session: SessionNodes, file: str, wish: NetworkWish) -> dict[int, DeviceWord]:
    """Return what describes each node of *wish* whose EDS only its identity tells.

    Silent nodes and other devices than in the file are left out.
    """
    found: dict[int, DeviceWord] = {}
    for node in _untold(file, wish):
        with suppress(NoAnswer, SdoAborted, SdoProtocolError):
            if is_wanted(session.network.node(node.node_id), node.identity):
                found |= _word(session, node.node_id)
    return found


def words_of_present(session: SessionNodes, file: str, wish: NetworkWish) -> dict[int, DeviceWord]:
    """Return what describes the nodes as `words_on_bus`, but raise for a silent node or another device, as a plan does.

    A node without a word has no EDS, rather than no power.
    """
    with session.network.as_it_was_if_refused():
        met = identify_nodes(session, file, replace(wish, nodes=tuple(_untold(file, wish)), links=()))
        met.end()
    return {node_id: word for node in met.nodes for node_id, word in _word(session, node).items()}


def _untold(file: str, wish: NetworkWish) -> list[NodeWish]:
    return [node for node in wish.nodes if simulated_word(file, node) is None]


def _word(session: SessionNodes, node_id: int) -> dict[int, DeviceWord]:
    files = session.network.files
    path = files.eds_path(node_id)
    return (
        {} if path is None else {node_id: DeviceWord(family_of(path) or str(path), files.modules(node_id, path) or ())}
    )

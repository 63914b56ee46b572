"""What describes nodes that a network file leads to nothing for: what the devices on the bus say that they are.

Reads who they are (0x1018), and no more.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError
from dvtcli.operations.network.described_network import simulated_word
from dvtcli.operations.wanted.identify_nodes import is_wanted, meet
from dvtcli.simulator.network.family_file import family_of

if TYPE_CHECKING:
    from dvtcli.domain.network.wanted_state import NetworkWish, NodeWish
    from dvtcli.operations.session.session import Session


def words_on_bus(session: Session, file: str, wish: NetworkWish) -> dict[int, str]:
    """What `--sim` takes for each node of *wish*, from *file*, that only its device tells, by the EDS it is known by.

    Not of a node that is silent, or another device than the file says.
    """
    found: dict[int, str] = {}
    for node in _untold(file, wish):
        with suppress(NoAnswer, SdoAborted, SdoProtocolError):
            if is_wanted(session.network.node(node.node_id), node.identity):
                found |= _word(session, node.node_id)
    return found


def words_of_present(session: Session, file: str, wish: NetworkWish) -> dict[int, str]:
    """The same for whom it is no answer that a node is silent, or another device: raises then, as a plan of it does.

    So what is left out has no EDS, and not a fuse that blew.
    """
    with session.network.as_it_was_if_refused():
        met = meet(session, file, replace(wish, nodes=tuple(_untold(file, wish)), links=()))
        met.end()
    return {node_id: word for node in met.nodes for node_id, word in _word(session, node).items()}


def _untold(file: str, wish: NetworkWish) -> list[NodeWish]:
    return [node for node in wish.nodes if simulated_word(file, node) is None]


def _word(session: Session, node_id: int) -> dict[int, str]:
    path = session.network.files.eds_path(node_id)
    return {} if path is None else {node_id: family_of(path) or str(path)}

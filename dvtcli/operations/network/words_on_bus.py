"""What describes nodes that a network file leads to nothing for: what the devices on the bus say that they are.

Reads who they are (0x1018), and no more.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError
from dvtcli.operations.network.described_network import simulated_word
from dvtcli.operations.wanted.meet_network import is_wanted
from dvtcli.simulator.network.family_file import family_of

if TYPE_CHECKING:
    from dvtcli.domain.network.wanted_state import NetworkWish
    from dvtcli.operations.session.session import Session


def words_on_bus(session: Session, file: str, wish: NetworkWish) -> dict[int, str]:
    """What `--sim` takes for each node of *wish*, from *file*, that only its device tells, by the EDS it is known by.

    Not of a node that is silent, or another device than the file says.
    """
    found: dict[int, str] = {}
    for one in wish.nodes:
        if simulated_word(file, one) is not None:
            continue
        with suppress(NoAnswer, SdoAborted, SdoProtocolError):
            node = session.network.node(one.node_id)
            path = session.network.files.eds_path(one.node_id)
            if path is not None and is_wanted(node, one.identity):
                found[one.node_id] = family_of(path) or str(path)
    return found

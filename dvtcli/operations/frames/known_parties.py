"""Who on the bus sends and takes which frames: nodes that are known or heard are read, a network file says the rest.

Only reads: SDO uploads.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.errors import BusUnavailable, NoAnswer, SdoAborted, SdoProtocolError
from dvtcli.operations.frames.layouts import HEARD_S, mapping_of
from dvtcli.operations.frames.node_services import node_services
from dvtcli.operations.meanings.physical_meanings import meanings_of
from dvtcli.watch.decoder import Decoder, pdo_layouts
from dvtcli.watch.frame_effect import Parties

if TYPE_CHECKING:
    from dvtcli.operations.session.session import Session

_NETWORK = (".yaml", ".yml")


class KnownParties:
    """What is known of a session's bus: *parties* with their PDOs, and a *decoder* of what those carry.

    Without *on_bus* no bus is opened: only the file says what is there.
    """

    def __init__(
        self, session: Session, nodes: Iterable[int] = (), file: str | None = None, *, on_bus: bool = True
    ) -> None:
        self._session = session
        self._asked: set[int] = set()
        self.parties, self.decoder = Parties(), Decoder()
        if file is not None:
            self._know_file(file)
        if not on_bus:
            return
        network = session.network
        known = {*nodes, *network.simulated_ids, *network.nodes, *network.bus.heard_nodes(), session.selected_id()}
        self._read(known_id for known_id in known if known_id is not None)

    def look_around(self) -> None:
        """Listen for nodes that are not known yet, and read those; not where all of them live in this process."""
        bus = self._session.wire
        if not bus.simulated:
            bus.sleep(HEARD_S)
            self._read(bus.heard_nodes())

    def _read(self, node_ids: Iterable[int]) -> None:
        for node_id in sorted(set(node_ids) - self._asked):
            self._asked.add(node_id)
            try:
                node = self._session.node(node_id)
                configs = node.pdos()
                services = list(node_services(node))
            except BusUnavailable:
                raise
            except (NoAnswer, SdoAborted, SdoProtocolError) as silent:
                self._session.tell.note(f"node {node_id}: its PDOs cannot be read ({silent.text})")
                continue
            self.parties.add(node_id, configs)
            for address, service in services:
                self.parties.services.setdefault(address, {})[service] = None
            meanings = meanings_of(node.profile, node.dictionary)
            self.decoder.add(
                pdo_layouts(node_id, configs, node.dictionary, meanings, mapping_of(self._session, node_id))
            )

    def _know_file(self, file: str) -> None:
        from dvtcli.operations.frames.file_layouts import file_layouts

        self.decoder.add(file_layouts(file, self._session.tell))
        if Path(file).suffix.lower() in _NETWORK:
            from dvtcli.operations.network.described_network import described_network

            for node in described_network(file).nodes:
                self.parties.add(node.node_id, node.pdos)
                self.parties.nodes.discard(node.node_id)  # what the device itself holds is not known by that

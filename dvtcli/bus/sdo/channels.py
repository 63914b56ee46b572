"""The default SDO channels of all nodes on one link, each made when it is first asked for.

Does not know how frames travel (see `sdo_link`), nor what an object means.
"""

from __future__ import annotations

import threading

from dvtcli.bus.sdo.channel import SdoChannel
from dvtcli.bus.sdo.client import StrictSdoClient
from dvtcli.bus.sdo.sdo_link import RESTARTED, DroppedAnswers, SdoLink, SdoSettings


class SdoChannels:
    """The channels over *link*; all share *settings*."""

    def __init__(self, link: SdoLink, settings: SdoSettings) -> None:
        self._link = link
        self._settings = settings
        self._lock = threading.Lock()
        self._clients: dict[int, StrictSdoClient] = {}
        self._channels: dict[int, SdoChannel] = {}

    def channel(self, node_id: int) -> SdoChannel:
        """The channel of *node_id*; the same object for the same node."""
        if node_id not in self._channels:
            with self._lock:
                if node_id not in self._channels:
                    client = self._clients[node_id] = StrictSdoClient(node_id, self._link, self._settings)
                    self._channels[node_id] = SdoChannel(client)
        return self._channels[node_id]

    def receive(self, node_id: int, can_id: int, data: bytes, *, extended: bool) -> None:
        """Take a frame of *node_id*'s channel, a request or an answer."""
        client = self._clients.get(node_id)
        if client is not None:
            client.receive(can_id, data, extended=extended)

    def restarted(self, node_id: int) -> None:
        """*node_id* sent a boot-up: what it was asked before that it has forgotten."""
        client = self._clients.get(node_id)
        if client is not None:
            client.inbox.put(RESTARTED)

    def repeated(self, node_id: int) -> int:
        """How many uploads of *node_id* had to be asked again so far."""
        client = self._clients.get(node_id)
        return 0 if client is None else client.repeated

    def dropped(self) -> dict[int, DroppedAnswers]:
        """How many answers did not count so far, by node-ID."""
        return {node_id: channel.dropped for node_id, channel in dict(self._channels).items()}

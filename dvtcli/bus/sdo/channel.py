"""One node's dictionary over its default SDO channel, for any number of threads.

Does not know how an answer is checked (see `dialogue`), nor what an object means.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

from dvtcli.bus.sdo.client import StrictSdoClient
from dvtcli.bus.sdo.sdo_link import DroppedAnswers
from dvtcli.errors import BusUnavailable, NoAnswer, SdoProtocolError

#: consumer heartbeat times (CiA 301, 7.5.2.17)
_HEARTBEAT_CONSUMERS = 0x1016

T = TypeVar("T")


class SdoChannel:
    """The SdoTransport of one node: one transfer at a time, other threads wait for their turn."""

    def __init__(self, client: StrictSdoClient) -> None:
        self._client = client
        self._turn = threading.Lock()

    @property
    def dropped(self) -> DroppedAnswers:
        """How many answers of this node did not count, and signs of another SDO client."""
        return self._client.dropped

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """Read an object, exactly as the device sends it, expedited or in segments.

        *timeout_s* for each answer and *retries* override the bus's. Raises SdoAborted, NoAnswer, SdoProtocolError,
        BusUnavailable.
        """
        link = self._client.link
        link.begin_transfer(self._turn)
        try:
            data = self._run(lambda: self._client.upload(index, sub_index), timeout_s, retries)
            self._note(index, sub_index, data)
            return data
        finally:
            link.end_transfer(self._turn)

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        """Write an object; a request is never repeated, since the device may have taken it.

        *timeout_s* for each answer overrides the bus's (a store takes seconds). Raises SdoAborted; and NoAnswer,
        SdoProtocolError, BusUnavailable with the state "unknown" once the request was sent.
        """
        link, node_id = self._client.link, self._client.node_id
        link.begin_transfer(self._turn)
        try:
            link.note_act(f"SDO download to 0x{index:04X}:{sub_index:02X} of node {node_id}")
            self._run(lambda: self._client.download(index, sub_index, data), timeout_s, 0)
        except (NoAnswer, SdoProtocolError, BusUnavailable) as error:
            if self._client.requested:
                error.state = "unknown"
            raise
        else:
            self._note(index, sub_index, data)
        finally:
            link.end_transfer(self._turn)

    def _note(self, index: int, sub_index: int, data: bytes) -> None:
        """Tell the bus of a consumer that expects heartbeats: whoever is late stops its machine."""
        if index == _HEARTBEAT_CONSUMERS and sub_index:
            self._client.link.consumes_heartbeat(self._client.node_id, sub_index, consumes=any(data))

    def _run(self, transfer: Callable[[], T], timeout_s: float | None, retries: int | None) -> T:
        client = self._client
        client.timeout_s = client.settings.timeout_s if timeout_s is None else timeout_s
        client.retries = client.settings.retries if retries is None else retries
        return transfer()

"""Heartbeats that a gateway's clients watch: each is told when one begins, is missed, and comes again.

Nothing is sent, and no node is changed: the node's own 0x1017 says how often it comes. Does not know lines.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.bus.node_watch import HEARTBEAT
from dvtcli.domain.gateway.error_numbers import GatewayError
from dvtcli.domain.gateway.gateway_answers import Answer, Done, Failed

if TYPE_CHECKING:
    from collections.abc import Callable

    from dvtcli.domain.ports import Frame
    from dvtcli.operations.gateway.line_client import LineClient
    from dvtcli.operations.session.session import Session

#: the orders that are answered here
HEARTBEATS = ("enable heartbeat", "disable heartbeat")
#: how much later than it came a heartbeat may be read (s): the bus is read once in a turn of the gateway
LATE_S = 0.05


class HeartbeatWatches:
    """What all clients watch."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._watches: list[Watch] = []
        self._stop: Callable[[], None] | None = None

    def close(self) -> None:
        """Listen no longer."""
        if self._stop is not None:
            self._stop()

    def answer(self, client: LineClient, node_id: int | None, numbers: tuple[int, ...]) -> Answer:
        """Watch *node_id* for *client* from now on, with the time (ms) in *numbers*, or no longer where none is."""
        if node_id is None:
            return Failed(GatewayError.NO_DEFAULT_NODE)
        if not 1 <= node_id <= 127:
            return Failed(GatewayError.UNSUPPORTED_NODE)
        bus = self._session.open_network().bus
        if not bus.carries_frames:
            return Failed(GatewayError.NOT_SUPPORTED, f"{bus.name} carries no CAN frames, so that no heartbeat either")
        self._watches = [watch for watch in self._watches if (watch.client, watch.node_id) != (client, node_id)]
        if numbers:
            self._stop = self._stop or bus.tap(self._note)
            self._watches.append(Watch(client, node_id, numbers[0] / 1000))
        return Done()

    def news(self) -> Iterator[tuple[LineClient, int, GatewayError]]:
        """Who is to be told what of which node, since the last call; who left watches nothing any more."""
        self._watches = [open_watch for open_watch in self._watches if not open_watch.client.gone]
        if not self._watches:
            return
        bus = self._session.open_network().bus
        bus.drain()  # what came while a client's line was done is not missed
        now_s = bus.now_s()
        for watch in self._watches:
            watch.look(now_s)
            while watch.news:
                yield watch.client, watch.node_id, watch.news.pop(0)

    def _note(self, frame: Frame, sent: bool) -> None:
        """Take a heartbeat; called by whoever reads the bus."""
        if sent or frame.extended or frame.remote or len(frame.data) != 1:
            return
        for watch in tuple(self._watches):
            if frame.can_id == HEARTBEAT + watch.node_id:
                watch.heard(frame.timestamp_s, self._session.bus.now_s())


class Watch:
    """The heartbeat of one node, as a *client* wants it: at least every *within_s* seconds, once it has begun."""

    def __init__(self, client: LineClient, node_id: int, within_s: float) -> None:
        self.client, self.node_id, self._within_s = client, node_id, within_s
        self.news: list[GatewayError] = []
        #: the last one: when by the bus's clock, and when it was read (s)
        self._stamp_s = 0.0
        self._heard_s: float | None = None

    def look(self, now_s: float) -> None:
        """Find out whether it is missed: one that came in time may be read a moment later."""
        if self._heard_s is not None and now_s - self._heard_s > self._within_s + LATE_S:
            self._lost()

    def heard(self, stamp_s: float, now_s: float) -> None:
        """One came, at *stamp_s* by the bus's clock (0: it has none); consumers wait from the first one on.

        Source: CiA 301, 7.2.8.3.2.2.
        """
        if self._heard_s is not None and stamp_s > 0 and self._stamp_s > 0:
            if stamp_s - self._stamp_s > self._within_s:
                self._lost()
        else:
            self.look(now_s)
        if self._heard_s is None:
            self.news.append(GatewayError.HEARTBEAT_STARTED)
        self._stamp_s, self._heard_s = stamp_s, now_s

    def _lost(self) -> None:
        self._heard_s = None
        self.news.append(GatewayError.HEARTBEAT_LOST)

"""A gateway for other programs (CiA 309-3): clients come and go, and each gets its answers in its turn.

One thread does everything. A client that says nothing, reads nothing or says nonsense is nobody else's trouble: one
line of each is done before the next one's turn. Who waits for a node that restarts waits alone. Does not know what
lines mean.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dvtcli.domain.gateway.error_numbers import GatewayError, GatewayRequestError
from dvtcli.domain.gateway.gateway_answers import Answer, Dialect, Failed, format_answer, format_event
from dvtcli.domain.gateway.parse import parse_request, sequence_of
from dvtcli.domain.node_events import BootUp, Emergency
from dvtcli.errors import BusUnavailable, SafetyRefusal
from dvtcli.operations.gateway.client_orders import NET
from dvtcli.operations.gateway.gateway_work import GatewayWork
from dvtcli.operations.gateway.line_client import MOST_LINES, LineClient
from dvtcli.operations.gateway.unattended import Unattended
from dvtcli.operations.opening.serve import is_loopback
from dvtcli.operations.results import Facts
from dvtcli.simulator.network.hub import Hub

if TYPE_CHECKING:
    from dvtcli.domain.gateway.requests import Request
    from dvtcli.domain.node_events import NodeEvent
    from dvtcli.operations.session.session import Session
    from dvtcli.simulator.network.hub_client import Client

#: where a gateway listens unless somebody says where
DEFAULT_PORT = 60000
#: how long is waited for clients, and how long the bus is read in between (s)
_TURN_S, _BUS_S = 0.02, 0.001


@contextmanager
def gateway(
    session: Session, where: tuple[str, int], *, allow_changes: bool = False, dialect: Dialect = Dialect.HASH
) -> Iterator[Gateway]:
    """A gateway to the bus of *session* at *where*, a loopback address; port 0 is a free one.

    Without *allow_changes* nothing is written or commanded. SafetyRefusal where others than this machine could reach
    it, BusUnavailable where the address or the bus is not to be had.
    """
    if not is_loopback(where[0]):
        raise SafetyRefusal(
            f"{where[0]} is no loopback address: a gateway has no login, and whoever reaches it reaches the bus",
            hint="--listen 127.0.0.1:60000, and ssh -L for who sits elsewhere",
        )
    bus = session.open_network().bus
    tell, session.tell = session.tell, Unattended(session.tell)
    served: Gateway | None = None
    work = GatewayWork(session, allow_changes=allow_changes)
    try:
        served = Gateway(session, where, work, dialect)
        stop = bus.on_event(served.note)
        try:
            yield served
        finally:
            stop()
    finally:
        session.tell = tell
        work.close()
        if served is not None:
            served.hub.close()


def serve_gateway(
    session: Session,
    where: tuple[str, int],
    begun: Callable[[Facts], None],
    *,
    allow_changes: bool = False,
    dialect: Dialect = Dialect.HASH,
) -> None:
    """Serve a gateway until Ctrl-C; *begun* is told where, once clients can come. Raises as `gateway`."""
    with gateway(session, where, allow_changes=allow_changes, dialect=dialect) as served:
        port = served.hub.port
        mode = "changes allowed" if allow_changes else "read-only"
        place = f"{f'[{where[0]}]' if ':' in where[0] else where[0]}:{port}"
        rows = (("host", where[0]), ("port", port), ("allow_changes", allow_changes), ("dialect", dialect.value))
        begun(Facts("gateway", rows, (f"listening on {place} (CiA 309-3, net {NET}, {mode}); Ctrl-C ends it",)))
        served.run()


class Gateway:
    """Lets clients in and does what they say with *work*; answers in *dialect*."""

    def __init__(self, session: Session, where: tuple[str, int], work: GatewayWork, dialect: Dialect) -> None:
        self._session, self._work, self._dialect = session, work, dialect
        try:
            self.hub = Hub(where, session.tell.note, admit=LineClient)
        except OSError as failed:
            raise BusUnavailable(
                f"cannot listen on {where[0]}:{where[1]}",
                why=failed.strerror or str(failed),
                hint="is another gateway running? --listen 127.0.0.1:0 takes a free port",
            ) from failed
        self._events: deque[NodeEvent] = deque(maxlen=1000)
        self._known: set[Client] = set()
        self._stopping = False

    def note(self, event: NodeEvent) -> None:
        """Keep what a node said by itself, from any thread."""
        self._events.append(event)

    def stop(self) -> None:
        """End `run`, from any thread."""
        self._stopping = True
        self.hub.wake()

    def run(self) -> None:
        """Serve until `stop`; raises where the bus is gone, KeyboardInterrupt for a Ctrl-C that came during a write.

        BusUnavailable says how the nodes are then, LeftChanged what a client's last change left.
        """
        try:
            self._serve()
        except BusUnavailable as gone:
            told = self._work.ended_by(gone)
            if told is gone:
                raise
            raise told from gone

    def _serve(self) -> None:
        while not self._stopping:
            if self._session.cancellation.requested:
                raise KeyboardInterrupt
            waiting = any(self._may_go_on(client) for client in self._clients())
            self.hub.wait(0.0 if waiting else _TURN_S, _may_read)
            for client in self._clients():
                if client.lines and not self._work.waits(client):
                    self._answer(client, client.lines.popleft())
            self._session.bus.idle(_BUS_S)
            self._tell_events()
            for client, request, answer in self._work.later():
                self._reply(client, request, answer)

    def _may_go_on(self, client: LineClient) -> bool:
        """Whether *client* said a line that, as far as is known, can be answered at once."""
        return bool(client.lines) and not client.stalled and not self._work.waits(client)

    def _clients(self) -> list[LineClient]:
        """Who is connected; who came or left since is said."""
        now = self.hub.connected
        for client in now:
            if client not in self._known:
                self._session.tell.note(f"client {client.name} connected")
        for client in self._known - set(now):
            self._session.tell.note(f"client {client.name} left")
        self._known = set(now)
        return [client for client in now if isinstance(client, LineClient)]

    def _answer(self, client: LineClient, line: str) -> None:
        sequence, _ = sequence_of(line[:64])
        try:
            request = parse_request(line)
        except GatewayRequestError as wrong:
            client.reply(self._line(format_answer(sequence, Failed(wrong.error, str(wrong)), self._dialect)))
            return
        client.opened = True
        client.stalled = request is not None and self._work.must_wait(client, request)
        if client.stalled:
            client.lines.appendleft(line)
        elif request is not None:
            answer = self._work.answer(client, request)
            if answer is not None:
                self._reply(client, request, answer)
        elif sequence is not None:
            empty = Failed(GatewayError.SYNTAX, "a command is missing")
            client.reply(self._line(format_answer(sequence, empty, self._dialect)))

    def _reply(self, client: LineClient, request: Request, answer: Answer) -> None:
        client.reply(self._line(format_answer(request.sequence, answer, self._dialect)))

    def _tell_events(self) -> None:
        while self._events:
            event = self._events.popleft()
            text = _event_line(event)
            for client in self._clients() if text else ():
                if client.told_boot_ups or not isinstance(event, BootUp):
                    client.put(self._line(text), self)

        for client, node_id, error in self._work.heartbeats.news():
            client.put(self._line(format_event(NET, node_id, error, self._dialect)), self)

    @staticmethod
    def _line(text: str) -> bytes:
        return f"{text}\r\n".encode("ascii")


def _may_read(client: Client) -> bool:
    return isinstance(client, LineClient) and len(client.lines) < MOST_LINES


def _event_line(event: NodeEvent) -> str:
    """What clients are told of *event*, empty for nothing."""
    if isinstance(event, BootUp):
        return f"{NET} {event.node_id} BOOT_UP"
    if isinstance(event, Emergency):
        own = " ".join(str(byte) for byte in event.manufacturer)
        return f"{NET} {event.node_id} EMCY {event.code:04X} {event.register:02X} {own}"
    return ""

"""A gateway for other programs (CiA 309-3), serving clients fairly.

Uses a single thread. A client that is silent, does not read or sends garbage does not affect others: the next line is
that of a newcomer, or of the client that took least time. Only requests for a restarting node wait for it.
"""

from __future__ import annotations

import errno
import os
import stat
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING

from dvtcli.device.change.private_file import is_own_user, replaceable
from dvtcli.domain.gateway_requests import parse_request, sequence_of
from dvtcli.domain.gateway_words import (
    Answer,
    Dialect,
    Failed,
    GatewayError,
    GatewayRequestError,
    format_answer,
    format_event,
)
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.ports import BootUp, Emergency
from dvtcli.errors import BusUnavailable, SafetyRefusal, UsageError
from dvtcli.operations.gateway.gateway_work import GatewayWork
from dvtcli.operations.gateway.line_client import MOST_LINES, NET, GatewayReporter, LineClient
from dvtcli.operations.results import Facts
from dvtcli.operations.session.serve import address, is_loopback
from dvtcli.simulator.network.hub import Address, Hub

if TYPE_CHECKING:
    from dvtcli.domain.gateway_requests import Request
    from dvtcli.domain.ports import NodeEvent
    from dvtcli.operations.results.frames import GatewayEvent
    from dvtcli.operations.session.session import Session, SessionNodes
    from dvtcli.simulator.network.hub_client import Client

#: default port of a gateway
DEFAULT_PORT = 60000
#: how long is waited for clients, for how long lines are answered before clients are heard again, and how long the bus
#: is read in between (s)
_TURN_S, _ANSWERING_S, _BUS_S = 0.02, 0.05, 0.001
#: minimum time counted for a line (s), so that fast lines count, too
_LEAST_S = 1e-4
#: maximum newcomers answered out of turn, and lines of others until another is allowed
_MOST_AT_ONCE = 8
#: how often a newcomer is passed over before it precedes later newcomers
_LATELY = 3
#: clients at once
MOST_CLIENTS = 256


@contextmanager
def gateway(
    session: Session,
    *where: Address,
    allow_changes: bool = False,
    any_user: bool = False,
    dialect: Dialect = Dialect.HASH,
    told: Callable[[GatewayEvent], None] | None = None,
) -> Iterator[Gateway]:
    """A gateway to the bus of *session* at *where*: loopback addresses (port 0: any), Unix socket paths.

    Without *allow_changes* writes and commands are refused. On Linux only the same user is admitted, unless *any_user*.
    *told* gets events, None: the session's user. Raises SafetyRefusal if other machines could connect, BusUnavailable
    if an address or the bus cannot be opened.
    """
    for endpoint in where:
        if isinstance(endpoint, str):
            _check_place_of(endpoint)
        elif not is_loopback(endpoint[0]):
            raise SafetyRefusal(
                f"{endpoint[0]} is not a loopback address: a gateway has no login; whoever reaches it reaches the bus",
                hint=Hint(Action.GIVE, {"listen": "127.0.0.1:60000"}, "{}, and ssh -L for who sits elsewhere"),
            )
    bus = session.open_network().bus
    reporter, unattended = session.reporter, GatewayReporter(session.reporter, told)
    session.reporter = unattended
    served: Gateway | None = None
    work = GatewayWork(session, unattended, allow_changes=allow_changes)
    try:
        served = Gateway(session, where, work, dialect, unattended, any_user=any_user)
        stop = bus.on_event(served.note)
        try:
            yield served
        finally:
            stop()
    finally:
        session.reporter = reporter
        work.close()
        if served is not None:
            served.hub.close()


def serve_gateway(
    session: Session,
    where: Sequence[Address],
    begun: Callable[[Facts], None],
    *,
    allow_changes: bool = False,
    any_user: bool = False,
    dialect: Dialect = Dialect.HASH,
    told: Callable[[GatewayEvent], None] | None = None,
) -> None:
    """Serve a gateway until Ctrl-C; calls *begun* with the address once ready. Raises as `gateway`."""
    with gateway(session, *where, allow_changes=allow_changes, any_user=any_user, dialect=dialect, told=told) as served:
        mode = "changes allowed" if allow_changes else "read-only"
        paths = [endpoint for endpoint in where if isinstance(endpoint, str)]
        hosts = [endpoint[0] for endpoint in where if not isinstance(endpoint, str)]
        ports = served.hub.ports
        places = [f"{f'[{host}]' if ':' in host else host}:{port}" for host, port in zip(hosts, ports, strict=True)]
        places += [f"unix:{path}" for path in paths]
        rows = (
            ("host", hosts[0] if hosts else None),
            ("port", served.hub.port),
            ("path", paths[0] if paths else None),
            ("listen", places),
            ("allow_changes", allow_changes),
            ("any_user", any_user),
            ("dialect", dialect.value),
        )
        place = " and ".join(places)
        begun(Facts("gateway", rows, (f"listening on {place} (CiA 309-3, net {NET}, {mode}); Ctrl-C ends it",)))
        served.run()


#: maximum bytes of a socket's path (sun_path), without NUL
_LONGEST_PATH = 107 if sys.platform == "linux" else 103


def listen_address(text: str) -> Address:
    """Read HOST:PORT, or `unix:PATH`; UsageError otherwise."""
    if not text.startswith("unix:"):
        return address(text)
    path = text.removeprefix("unix:")
    if not path or "\0" in path:
        raise UsageError("not unix:PATH", given={"listen": text}, hint="for example unix:gateway.sock")
    return path


def _check_place_of(path: str) -> None:
    """UsageError if no socket can be at *path*; SafetyRefusal if anybody could put another socket in its place."""
    folder = os.path.dirname(os.path.abspath(path))  # noqa: PTH100, PTH120
    if not os.path.isdir(folder):  # noqa: PTH112 - Path.is_dir raises OSError for a name that is too long
        raise UsageError(f"unix:{path}: no such folder: {folder}", place=path)
    if os.path.isdir(path):  # noqa: PTH112
        hint = f"name a socket in it, as unix:{os.path.join(path, 'gateway.sock')}"  # noqa: PTH118
        raise UsageError(f"unix:{path}: it is a folder", place=path, hint=hint)
    if len(os.fsencode(path)) > _LONGEST_PATH:
        raise UsageError(
            f"unix:{path}: the path of a socket has at most {_LONGEST_PATH} bytes",
            place=path,
            hint="choose a shorter path, for example unix:gateway.sock in the current folder",
        )
    if os.path.exists(path) and not stat.S_ISSOCK(os.stat(path).st_mode):  # noqa: PTH110, PTH116
        raise UsageError(f"unix:{path}: there is a file of this name", place=path, hint="take another name")
    if (found := replaceable(folder)) is not None:
        raise SafetyRefusal(f"unix:{path}: {found[0]}", place=path, hint=found[1])


class Gateway:
    """Accepts clients, runs their requests by *work* and answers in *dialect*."""

    def __init__(
        self,
        session: SessionNodes,
        where: Sequence[Address],
        work: GatewayWork,
        dialect: Dialect,
        reporter: GatewayReporter,
        *,
        any_user: bool,
    ) -> None:
        self._session, self._work, self._dialect, self._tell = session, work, dialect, reporter
        may_come = None if any_user or sys.platform != "linux" else is_own_user
        try:
            self.hub = Hub(where, reporter.note, admit=LineClient, most=MOST_CLIENTS, may_come=may_come)
        except OSError as failed:
            place = " and ".join(
                f"unix:{endpoint}" if isinstance(endpoint, str) else f"{endpoint[0]}:{endpoint[1]}"
                for endpoint in where
            )
            text, why = f"cannot listen on {place}", failed.strerror or str(failed)
            if failed.errno != errno.EADDRINUSE and any(isinstance(endpoint, str) for endpoint in where):
                raise UsageError(text, why=why, hint="take a socket in a folder that you may write to") from failed
            hint = Hint(Action.GIVE, {"listen": "127.0.0.1:0"}, "is another gateway running? {} takes a free port")
            raise BusUnavailable(text, why=why, hint=hint) from failed
        #: count of line time (s)
        self._turn_s = 0.0
        self._newcomer_next = False
        #: how often newcomers have been passed by, and how many may still be next at once, out of turn
        self._passed: dict[LineClient, int] = {}
        self._at_once = float(_MOST_AT_ONCE)
        self._events: deque[NodeEvent] = deque(maxlen=1000)
        self._known: set[Client] = set()
        self._stopping = False

    def note(self, event: NodeEvent) -> None:
        """Keep a node's event, from any thread."""
        self._events.append(event)

    def stop(self) -> None:
        """End `run`, from any thread."""
        self._stopping = True
        self.hub.wake()

    def run(self) -> None:
        """Serve until `stop`; raises if the bus is lost, KeyboardInterrupt for a Ctrl-C during a write.

        BusUnavailable has the nodes' state, LeftChanged what a client's last change left.
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
            self._answer_lines()
            self._session.bus.idle(_BUS_S)
            self._tell_events()
            for client, request, answer in self._work.later():
                self._reply(client, request, answer)

    def _answer_lines(self) -> None:
        """Answer lines for a short while: by turns of the newest client and the client with least time."""
        until_s = monotonic() + _ANSWERING_S
        clients, stalled = self._clients(), set[LineClient]()
        while ready := [
            line_client
            for line_client in clients
            if line_client.lines and line_client not in stalled and not self._work.waits(line_client)
        ]:
            client = self._next(ready)
            begun_s = monotonic()
            self._answer(client, client.lines.popleft(), alone=len(clients) == 1)
            ended_s = monotonic()
            self._turn_s = max(self._turn_s, client.turn_s)
            client.turn_s = self._turn_s + max(ended_s - begun_s, _LEAST_S)
            if client.stalled:
                stalled.add(client)
            if ended_s >= until_s:
                break

    def _next(self, ready: list[LineClient]) -> LineClient:
        """Choose the next line: of a client new since the last line, else by turns a newcomer and an older client.

        A client that reconnects for each line is preferred for some lines only: their number grows slowly as others are
        served. Of the last two newcomers the earlier goes first, so that newcomers are not always last.
        """
        newcomers = [client for client in ready if not client.turn_s]
        known = [client for client in ready if client.turn_s]
        just_come = [newcomer for newcomer in newcomers if newcomer not in self._passed]
        if known and just_come and self._newcomer_next and self._at_once >= 1:
            self._at_once -= 1
        else:
            self._newcomer_next = not known or (bool(newcomers) and not self._newcomer_next)
            if not self._newcomer_next:
                self._at_once = min(self._at_once + 1 / _MOST_AT_ONCE, _MOST_AT_ONCE)
        lately = [newcomer for newcomer in newcomers[-2:] if self._passed.get(newcomer, 0) <= _LATELY]
        self._passed = {newcomer: self._passed.get(newcomer, 0) + 1 for newcomer in newcomers}
        if self._newcomer_next:
            return lately[0] if lately else newcomers[-1]
        return min(known, key=lambda waiting_client: waiting_client.turn_s)

    def _may_go_on(self, client: LineClient) -> bool:
        """Tell whether *client* has a line that, as far as known, can be answered at once."""
        return bool(client.lines) and not client.stalled and not self._work.waits(client)

    def _clients(self) -> list[LineClient]:
        """Return the connected clients; reports changes."""
        now = self.hub.connected
        for client in now:
            if client not in self._known:
                self._tell.happened("connected", f"client {client.name} connected", client=client.name)
        for client in self._known - set(now):
            self._tell.happened("left", f"client {client.name} left", client=client.name)
        self._known = set(now)
        return [client for client in now if isinstance(client, LineClient)]

    def _answer(self, client: LineClient, line: str, *, alone: bool) -> None:
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
            answer = self._work.answer(client, request, alone=alone)
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
    """Return the line about *event* for clients, empty if none."""
    if isinstance(event, BootUp):
        return f"{NET} {event.node_id} BOOT_UP"
    if isinstance(event, Emergency):
        own = " ".join(str(byte) for byte in event.manufacturer)
        return f"{NET} {event.node_id} EMCY {event.code:04X} {event.register:02X} {own}"
    return ""

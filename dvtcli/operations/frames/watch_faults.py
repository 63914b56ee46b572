"""Show the EMCY messages of all nodes. Only reads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING

from dvtcli.bus.node_watch import read_emergency
from dvtcli.domain.ports import Emergency, ReceivedEmergency
from dvtcli.errors import BusUnavailable, DvtcliError
from dvtcli.operations.frames.layouts import open_wire
from dvtcli.operations.frames.watch_bus import ListeningTime
from dvtcli.operations.nodes.show_faults import ErrorWords
from dvtcli.operations.results.nodes import FaultSeen
from dvtcli.operations.session.steady_listener import SteadyListener

if TYPE_CHECKING:
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.session.session_nodes import SessionNodes


def watch_faults(
    session: Session, show: Callable[[Iterable[FaultSeen]], None], duration_s: float | None = None
) -> None:
    """Show EMCY messages, earlier ones first, for *duration_s* seconds (None: forever).

    Selected, simulated and met nodes are identified once, for the error codes of their family. Raises UsageError if the
    bus carries no frames, BusUnavailable if it fails.
    """
    bus = open_wire(session)
    counter = _Counter(session)
    before = [emergency for node_id in range(1, 128) for emergency in bus.received_emergencies(node_id)]
    session.reporter.note("listening for EMCY messages; Ctrl-C ends it")
    with SteadyListener(session) as listener:
        show(map(counter.received, sorted(before, key=lambda fault: fault.last.timestamp_s)))
        for wait_s in _waits(bus.now_s, duration_s):
            received = (read_emergency(frame) for frame in listener.take(wait_s))
            show(counter.take(emergency) for emergency in received if emergency is not None)


def _waits(now_s: Callable[[], float], duration_s: float | None) -> Iterator[float]:
    """Yield waiting times (s) until *duration_s* is over, then 0 for received messages."""
    time = ListeningTime(duration_s, now_s)
    while not time.is_over():
        yield time.batch_s
    yield 0.0


class _Counter:
    """EMCY messages with meanings, counted by node and code."""

    def __init__(self, session: SessionNodes) -> None:
        network = session.network
        node_ids = {session.selected_id(), *network.simulated_ids, *network.nodes} - {None}
        self._words = {node_id: _words(session, node_id) for node_id in node_ids if node_id is not None}
        self._seen: dict[tuple[int, int], ReceivedEmergency] = {}

    def received(self, one: ReceivedEmergency) -> FaultSeen:
        """Count an earlier message."""
        node_id = one.last.node_id
        self._seen[node_id, one.last.code] = one
        return FaultSeen(node_id, self._words.setdefault(node_id, ErrorWords()).received(one))

    def take(self, said: Emergency) -> FaultSeen:
        """Count a new message."""
        before = self._seen.get((said.node_id, said.code))
        first_s, count = (said.timestamp_s, 0) if before is None else (before.first_s, before.count)
        return self.received(ReceivedEmergency(count + 1, first_s, said))


def _words(session: SessionNodes, node_id: int) -> ErrorWords:
    """Return the error codes of the node's family; the standard's, with a message, if it does not answer."""
    try:
        return ErrorWords(session.node(node_id))
    except BusUnavailable:
        raise
    except DvtcliError as silent:
        session.reporter.note(
            f"node {node_id} does not say who it is ({silent.text}): the standard's words tell its errors"
        )
        return ErrorWords()

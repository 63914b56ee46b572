"""The EMCY messages of every node as they come. Only reads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING

from dvtcli.bus.node_watch import read_emergency
from dvtcli.domain.ports import Emergency, HeardEmergency
from dvtcli.errors import BusUnavailable, DvtcliError
from dvtcli.operations.frames.layouts import open_wire
from dvtcli.operations.frames.watch_bus import ListeningTime
from dvtcli.operations.nodes.show_faults import ErrorWords
from dvtcli.operations.results.node_errors import FaultSeen
from dvtcli.operations.session.steady_listener import SteadyListener

if TYPE_CHECKING:
    from dvtcli.operations.session.session import Session


def watch_faults(
    session: Session, show: Callable[[Iterable[FaultSeen]], None], duration_s: float | None = None
) -> None:
    """Show each EMCY message for *duration_s* seconds, None for ever; those that came before, first.

    Of the selected node, and of those that are simulated or were met, codes are in the words of their family: they are
    asked once who they are. UsageError where the bus carries no frames, BusUnavailable where it fails.
    """
    bus = open_wire(session)
    counter = _Counter(session)
    before = [emergency for node_id in range(1, 128) for emergency in bus.heard_emergencies(node_id)]
    session.tell.note("listening for EMCY messages; Ctrl-C ends it")
    with SteadyListener(session) as listener:
        show(map(counter.heard, sorted(before, key=lambda fault: fault.last.timestamp_s)))
        for wait_s in _waits(bus.now_s, duration_s):
            heard = (read_emergency(frame) for frame in listener.take(wait_s))
            show(counter.take(emergency) for emergency in heard if emergency is not None)


def _waits(now_s: Callable[[], float], duration_s: float | None) -> Iterator[float]:
    """How long to wait for messages each time (s) until *duration_s* is over; then for those that are there by then."""
    time = ListeningTime(duration_s, now_s)
    while not time.is_over():
        yield time.batch_s
    yield 0.0


class _Counter:
    """Messages with what they mean, counted by node and code."""

    def __init__(self, session: Session) -> None:
        network = session.network
        node_ids = {session.selected_id(), *network.simulated_ids, *network.nodes} - {None}
        self._words = {node_id: _words(session, node_id) for node_id in node_ids if node_id is not None}
        self._seen: dict[tuple[int, int], HeardEmergency] = {}

    def heard(self, one: HeardEmergency) -> FaultSeen:
        """Messages that came before."""
        node_id = one.last.node_id
        self._seen[node_id, one.last.code] = one
        return FaultSeen(node_id, self._words.setdefault(node_id, ErrorWords()).heard(one))

    def take(self, said: Emergency) -> FaultSeen:
        """One message that came now."""
        before = self._seen.get((said.node_id, said.code))
        first_s, count = (said.timestamp_s, 0) if before is None else (before.first_s, before.count)
        return self.heard(HeardEmergency(count + 1, first_s, said))


def _words(session: Session, node_id: int) -> ErrorWords:
    """The words of a node's family; the standard's where it does not answer, which is said."""
    try:
        return ErrorWords(session.node(node_id))
    except BusUnavailable:
        raise
    except DvtcliError as silent:
        session.tell.note(
            f"node {node_id} does not say who it is ({silent.text}): the standard's words tell its errors"
        )
        return ErrorWords()

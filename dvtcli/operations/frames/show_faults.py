"""Show a node's errors in words, and the EMCY messages of all nodes; clear a node's error history."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.bus.node_watch import read_emergency
from dvtcli.device.error_history import clear_history, read_fault_list, read_history, read_register
from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.emergency_codes import emergency_remedy, emergency_text
from dvtcli.domain.objects import DEVICE_TYPE
from dvtcli.domain.ports import Emergency, ReceivedEmergency
from dvtcli.errors import BusUnavailable, DvtcliError
from dvtcli.operations.frames.layouts import open_wire
from dvtcli.operations.frames.watch_bus import ListeningTime
from dvtcli.operations.results.nodes import FaultRow, Faults, FaultSeen
from dvtcli.operations.session.steady_listener import SteadyListener

if TYPE_CHECKING:
    from dvtcli.device.error_history import HistoryEntry
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.operations.session.session import Session, SessionNodes


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


def show_faults(session: SessionNodes, node_id: int | None = None) -> Faults:
    """Read the errors of node *node_id*, or the selected node, and add its received EMCY messages.

    Only reads, except for a family's own list, whose positions are selected by a write (not under --dry-run).
    """
    node = session.node(node_id)
    words = ErrorWords(node)
    own, history = node.profile.fault_list, read_history(node.sdo)
    active = () if own is None else read_fault_list(node.access, own, may_choose=not session.dry_run)
    if active and session.dry_run:
        session.reporter.note(
            "in a dry run the node's own list is read only where it stands: to choose a position is a write"
        )
    rows = [words.row("active", code) for code in active]
    rows += words.of_history(history or ())
    rows += [words.received(emergency) for emergency in node.bus.received_emergencies(node.node_id)]
    return Faults(
        node.node_id, node.profile.title, read_register(node.sdo), history is not None, tuple(rows),
        dry_run=session.dry_run,
    )  # fmt: skip


def clear_faults(session: SessionNodes, node_id: int | None = None) -> Faults:
    """Clear the error history of node *node_id*, or the selected node, and verify.

    Errors themselves stay: 0x6040 and all else that could move something is left alone. Raises as `clear_history`.
    """
    node = session.node(node_id)
    words = ErrorWords(node)
    with session.cancellation.deferred():
        before = clear_history(node.access)
    rows = tuple(words.of_history(before))
    return Faults(
        node.node_id, node.profile.title, read_register(node.sdo), True, rows, cleared=True, dry_run=session.dry_run
    )  # fmt: skip


class ErrorWords:
    """Error codes in words, by the family of *node* or the standard; None: unknown node."""

    def __init__(self, node: ReadableNode | None = None) -> None:
        self._known = {} if node is None else node.profile.faults
        self._device_type = None if node is None else read_optional(node.sdo, DEVICE_TYPE, 0, 4)

    def row(self, source: str, code: int) -> FaultRow:
        """Describe *code* of *source*."""
        known = self._known.get(code)
        if known is not None:
            return FaultRow(source, code, known.text, known.remedy)
        if source == "active":
            return FaultRow(source, code, "an error of the maker's own list: its manual says which")
        return FaultRow(source, code, emergency_text(code, self._device_type), emergency_remedy(code))

    def of_history(self, history: Iterable[HistoryEntry]) -> list[FaultRow]:
        """Describe an error history."""
        return [replace(self.row("history", entry.code), information=entry.information) for entry in history]

    def received(self, one: ReceivedEmergency) -> FaultRow:
        """Describe a received message."""
        last = one.last
        return replace(
            self.row("heard", last.code), count=one.count, first_s=one.first_s, last_s=last.timestamp_s,
            register=last.register, manufacturer=last.manufacturer,
        )  # fmt: skip

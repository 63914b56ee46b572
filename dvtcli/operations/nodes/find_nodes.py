"""Find what is on a bus: nodes by heartbeat and by asking each node-ID, and the bit rate by listening at each.

At a wrong bit rate, a controller destroys frames of others unless in listen-only mode: without this mode it does not
listen.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from dvtcli.device.read_pdos import ABSENT, read_identity, read_optional
from dvtcli.domain.abort import Abort
from dvtcli.domain.can_ids import SDO_RESPONSE_BASE
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.lss_services import BIT_TIMINGS
from dvtcli.domain.objects import DEVICE_TYPE, IDENTITY, PRODUCER_HEARTBEAT
from dvtcli.errors import BusUnavailable, DvtcliError, NoAnswer, SafetyRefusal, SdoAborted, SdoProtocolError
from dvtcli.operations.results import NodeListing, NodeRow
from dvtcli.operations.results.lss_nodes import BitRateFound, ReceivedAt

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.ports import CanopenBus, Frame, SdoTransport
    from dvtcli.operations.session.session import Session, SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


def device_name(sdo: SdoTransport) -> str:
    """Read the manufacturer's device name (0x1008), empty if absent or aborted twice.

    It needs a segmented upload, which a device may abort for temporary reasons.
    """
    for _ in range(2):
        try:
            return sdo.upload(0x1008, 0).rstrip(b"\0").decode("latin-1")
        except SdoAborted as aborted:
            if aborted.code in ABSENT:
                break
    return ""


class SaidOfItself:
    """The identity (0x1018) in *row*, readable like an SDO channel; refuses other objects."""

    def __init__(self, row: NodeRow) -> None:
        parts = enumerate((row.vendor_id, row.product_code, row.revision, row.serial), 1)
        self._node = row.node
        self._said = {(IDENTITY, sub): part.to_bytes(4, "little") for sub, part in parts if part is not None}

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """Return the known value; raises SdoAborted otherwise."""
        del timeout_s, retries
        if (index, sub_index) not in self._said:
            raise SdoAborted(index, sub_index, Abort.NO_OBJECT, node=self._node)
        return self._said[index, sub_index]


def identify(session: Session, node_id: int | None = None) -> NodeListing:
    """Identify *node_id*, which is then selected, or the selected node.

    Raises UsageError if none is selected, NoAnswer if silent.
    """
    if node_id is not None and not session.in_script:
        session.network.accept(node_id)
    row = _described(session, _row(session.node(node_id)))
    if node_id is not None:
        session.selected = node_id
    return NodeListing(session.bus.name, (row,), detail=True)


def _described(session: SessionNodes, row: NodeRow) -> NodeRow:
    """Add to *row* why its file describes the node."""
    chosen = session.network.files.choice(row.node)
    if chosen is None or chosen.path.name != row.source:
        return row
    return replace(row, eds_why=chosen.why, eds_note=chosen.note)


def _row(node: ReadableNode) -> NodeRow:
    sdo = node.sdo
    vendor, product, revision, serial = (read_identity(sdo, sub) for sub in (1, 2, 3, 4))
    state = node.access.state()
    return NodeRow(
        node.node_id, state.label if state is not None else "state unknown", read_optional(sdo, DEVICE_TYPE, 0, 4),
        vendor, product, revision, serial, device_name(sdo), node.profile.name,
        node.dictionary.source if node.dictionary else "",
    )  # fmt: skip


def silent(node_id: int, error: DvtcliError, state: str) -> NodeRow:
    """Describe a node that is heard but answers SDO not at all, or with nonsense."""
    return NodeRow(node_id, state, note=error.text)


_Said = TypeVar("_Said")
#: How long each node-ID has to answer, in seconds, and how many are asked at once.
_ANSWER_S = 0.05
_AT_ONCE = 8
#: The state of a node never heard: it sends no heartbeat (0x1017 is 0 or missing), or none was received yet.
_UNHEARD = _NO_HEARTBEAT, _UNKNOWN = "no heartbeat", "state unknown"
#: Heartbeats are usually sent once a second or faster.
_LISTEN_S = 1.0


def find_nodes(session: SessionNodes, answer_s: float = _ANSWER_S) -> NodeListing:
    """List nodes 1…127 that are heard or answer; *answer_s* (s) is the time-out of the first answer.

    Nodes that are heard or answer late get the bus's time-out as well before they count as silent. Only reads. Raises
    BusUnavailable without a bus; an error of a node is a note in its row. Reports interrupted changes.
    """
    started = time.monotonic()
    bus = session.bus
    if not bus.simulated:
        for _ in bus.receive(_LISTEN_S):
            pass  # heartbeats are noted by the bus itself
    found = _each_asked(bus, answer_s, lambda node_id, limit_s: _ask(bus, node_id, limit_s))
    rows = [_with_file(session, _with_own_state(session, row)) for row in found]
    rows.sort(key=lambda row: row.node)
    session.network.scanned = tuple(row.node for row in rows)
    _note_interrupted(session)
    return NodeListing(bus.name, tuple(rows), time.monotonic() - started)


def _note_interrupted(session: SessionNodes) -> None:
    """Report the interrupted changes of nodes of this bus, whether these answer or not."""
    from dvtcli.operations.changes.waiting_journals import waiting_ids

    network = session.network
    if network.change_files is not None:
        for node_id in waiting_ids(session):
            network.change_files.guard(node_id, None)


def answering_ids(bus: CanopenBus) -> list[int]:
    """The node-IDs 1…127 that answer an SDO upload, whatever they answer; asked as `find_nodes` asks. Only reads."""
    return sorted(_each_asked(bus, _ANSWER_S, lambda node_id, limit_s: _answers_at_all(bus, node_id, limit_s)))


def _answers_at_all(bus: CanopenBus, node_id: int, limit_s: float | None) -> int | None:
    try:
        _device_type(bus.sdo(node_id), limit_s, received=False)
    except NoAnswer:
        return None
    except SdoProtocolError:
        return node_id  # who answers wrongly is there, too
    return node_id


def _each_asked(bus: CanopenBus, answer_s: float, ask: Callable[[int, float | None], _Said | None]) -> list[_Said]:
    """Call *ask*(node-ID, time-out in s) for each node-ID 1…127; again for late answers."""
    with ThreadPoolExecutor(_AT_ONCE) as pool, _answers(bus) as answered:
        found = list(pool.map(lambda node_id: ask(node_id, answer_s), range(1, 128)))
        if not bus.simulated:
            bus.sleep(answer_s)
        late = [node_id for node_id, said in enumerate(found, 1) if said is None and node_id in answered]
        found += pool.map(lambda node_id: ask(node_id, None), late)
    return [said for said in found if said is not None]


def _with_own_state(session: SessionNodes, row: NodeRow) -> NodeRow:
    """Add the NMT state of the node's own state object, if not heard and its family has the object."""
    node = session.network.nodes.get(row.node)
    if row.state not in _UNHEARD or node is None or node.profile.state_object is None:
        return row
    try:
        state = node.access.state()
    except (NoAnswer, SdoAborted, SdoProtocolError):
        return row
    return row if state is None else replace(row, state=state.label)


def _with_file(session: SessionNodes, row: NodeRow) -> NodeRow:
    """Add the node's file by its identity, and problems of the file.

    Reads only library files changed since they were added.
    """
    from dvtcli.operations.devices.eds_library import problem_of

    if row.note:
        return row
    chosen = session.network.files.choice(row.node, SaidOfItself(row))
    if chosen is None:
        return row
    session.network.files.was_said(chosen.note)
    wrong = problem_of(chosen.path)
    note = f"{wrong}; add the file again, or remove it from the library" if wrong else chosen.note
    return replace(row, source=chosen.path.name, eds_why=chosen.why, eds_note=note)


@contextmanager
def _answers(bus: CanopenBus) -> Iterator[set[int]]:
    """Collect node-IDs that answer any SDO request meanwhile, even late."""
    answered: set[int] = set()

    def note(frame: Frame, sent: bool) -> None:
        if not sent and not frame.extended and 1 <= frame.can_id - SDO_RESPONSE_BASE <= 127:
            answered.add(frame.can_id - SDO_RESPONSE_BASE)

    stop = bus.tap(note)
    try:
        yield answered
    finally:
        stop()


def _ask(bus: CanopenBus, node_id: int, limit_s: float | None) -> NodeRow | None:
    """Read the row of *node_id*, None if nobody is there; an error is a note in the row.

    *limit_s* is the time-out in seconds, None: the bus's.
    """
    from dvtcli.files.profiles import profile_for_identity

    sdo = bus.sdo(node_id)
    state = bus.nmt_state(node_id)
    label = state.label if state is not None else _UNKNOWN
    try:
        device_type = _device_type(sdo, limit_s, received=state is not None)
    except NoAnswer as error:
        return None if state is None else silent(node_id, error, label)
    except SdoProtocolError as error:
        return silent(node_id, error, label)
    label = _silent(sdo) if state is None else label
    row = NodeRow(node_id, label, device_type)
    try:
        vendor, product, revision, serial = (read_identity(sdo, sub) for sub in (1, 2, 3, 4))
        profile = "" if vendor is None else profile_for_identity(vendor, product or 0).name
        row = NodeRow(node_id, label, device_type, vendor, product, revision, serial, profile=profile)
        return replace(row, name=device_name(sdo))
    except (NoAnswer, SdoProtocolError) as error:
        return replace(row, note=error.text)


def _device_type(sdo: SdoTransport, limit_s: float | None, *, received: bool) -> int | None:
    """Read 0x1000, None if refused; raises NoAnswer, SdoProtocolError if unreadable."""
    try:
        try:
            data = sdo.upload(DEVICE_TYPE, 0, timeout_s=limit_s, retries=0)
        except NoAnswer:
            if not received:
                raise
            data = sdo.upload(DEVICE_TYPE, 0)
    except SdoAborted:
        return None
    return int.from_bytes(data[:4], "little")


def _silent(sdo: SdoTransport) -> str:
    """Describe the state of a node that answers but was not heard."""
    try:
        return _UNKNOWN if read_optional(sdo, PRODUCER_HEARTBEAT, 0, 2) else _NO_HEARTBEAT
    except (NoAnswer, SdoAborted, SdoProtocolError):
        return _UNKNOWN


#: How long each bit rate is listened to (s): nodes usually send a heartbeat once a second or more often.
LISTEN_S = 1.5
#: the standard's bit rates (bit/s), most frequent first
ORDER = (500_000, 250_000, 125_000, 1_000_000, 50_000, 20_000, 10_000, 800_000)
assert set(ORDER) == set(BIT_TIMINGS)  # noqa: S101 - all of them


def find_bit_rate(session: SessionNodes, listen_s: float = LISTEN_S) -> BitRateFound:
    """Listen at each standard bit rate for *listen_s* seconds, until frames arrive without errors.

    Raises SafetyRefusal, with a remedy, if listen-only mode is not guaranteed (unless forced, after a question; used
    anyway if available), or the bit rate cannot be set. An open bus returns to its bit rate. Raises BusUnavailable.
    """
    try:
        return _found(session, listen_s, silent=True)
    except (SafetyRefusal, BusUnavailable):  # also: it does not confirm listen-only mode
        if not _spoken(session):
            raise
    return _found(session, listen_s, silent=False)


def _found(session: SessionNodes, listen_s: float, *, silent: bool) -> BitRateFound:
    with _listening(session, listen_only=silent) as (bus, rates):
        received: list[ReceivedAt] = []
        for number, bit_rate in enumerate(rates):
            session.reporter.progress(f"listening at {bit_rate} bit/s, {listen_s:g} s", number, len(rates))
            if bus.runs_at != bit_rate or not silent:
                bus.set_bit_rate(bit_rate, listen_only=silent)
            received.append(_received(bus, bit_rate, listen_s))
            if received[-1].frames and not received[-1].error_frames:
                return BitRateFound(bus.name, bit_rate, tuple(received), listen_s, silent)
        return BitRateFound(bus.name, None, tuple(received), listen_s, silent, complete=len(rates) == len(ORDER))


def _spoken(session: SessionUser) -> bool:
    """Tell whether frames of others may be destroyed: forced, and confirmed."""
    if not session.options.force or session.dry_run:
        return False
    session.consent("without listen-only mode a wrong bit rate destroys the frames of others; is the machine at rest?")
    return True


def _received(bus: CanopenBus, bit_rate: int, listen_s: float) -> ReceivedAt:
    for _ in bus.receive(0.0):
        pass  # what came before came at another bit rate
    errors = bus.error_frame_count()
    frames = sum(1 for _ in bus.receive(listen_s))
    return ReceivedAt(bit_rate, frames, bus.error_frame_count() - errors)


@contextmanager
def _listening(session: SessionNodes, *, listen_only: bool) -> Iterator[tuple[CanopenBus, Sequence[int]]]:
    """Open a bus for listening, with the bit rates it supports."""
    if session.is_open or session.options.sim:
        with _lent(session, listen_only=listen_only) as bus:
            yield bus, ORDER
        return
    from dvtcli.operations.session.open_network import listening_bus

    session.require_settings()
    bus = listening_bus(session.base, ORDER[0], listen_only=listen_only)
    try:
        bus.require_settable(ORDER[0], listen_only=listen_only)
        rates: Sequence[int] = ORDER
    except SafetyRefusal:  # it listens as it is, and somebody else sets it
        rates = (bus.runs_at,) if bus.runs_at else ()
    try:
        yield bus, rates
    finally:
        bus.close()


@contextmanager
def _lent(session: SessionNodes, *, listen_only: bool) -> Iterator[CanopenBus]:
    """Use the open bus, and restore its bit rate."""
    bus = session.open_network().bus
    bus.require_settable(ORDER[0], listen_only=listen_only)
    before = bus.runs_at
    if before is None:
        raise SafetyRefusal(
            f"the bit rate of {bus.name} is not known, so that it could not be set back",
            hint=Hint(Action.LISTEN_BIT_RATE, why="exit, then {}")
            + Hint(Action.GIVE_BIT_RATE, why="or open it with {}"),
        )
    try:
        bus.set_bit_rate(before, listen_only=listen_only)
        yield bus
    finally:
        bus.set_bit_rate(before)
        bus.disturbances()  # what was noticed at wrong bit rates is no news

"""The SYNC message of a node, and SYNC by unknown producers while nodes are read. Sends nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.can_ids import SYNC_ID
from dvtcli.domain.cob_id import SYNC_BY_DEFAULT, can_id_text
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.objects import COB_ID_SYNC, CYCLE_PERIOD
from dvtcli.domain.ports import Frame
from dvtcli.domain.rules.finding import WARNING, Rule, warning
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.ports import CanopenBus, SdoTransport
    from dvtcli.operations.results import SyncCheck, SyncSource
    from dvtcli.operations.session.session import SessionNodes

#: the default SYNC (CiA 301, 7.5.2.5)
DEFAULT = Frame(SYNC_ID, b"")
_EXTENDED = 1 << 29


def sync_frame(sdo: SdoTransport) -> Frame:
    """Return a SYNC with the CAN-ID of the node's 0x1005; 0x080 if absent or unanswered."""
    try:
        raw = int.from_bytes(sdo.upload(COB_ID_SYNC, 0, retries=0)[:4], "little")
    except (NoAnswer, SdoAborted):
        return DEFAULT
    if raw & _EXTENDED:
        return Frame(raw & 0x1FFF_FFFF, b"", extended=True)
    return Frame(raw & 0x7FF, b"") if raw & 0x7FF else DEFAULT


RULES = (Rule("sync-producer", WARNING, "no known node produces SYNC", "CiA 301, 7.5.2.5 and 7.5.2.6"),)
#: The bus is recorded for two periods of the slowest node, within these limits, in seconds.
_SHORTEST_S, _LONGEST_S = 0.1, 2.5


def check_sync(session: SessionNodes, node_ids: Iterable[int] = ()) -> SyncCheck:
    """Read nodes, record the bus, and warn if no node produces SYNC; sends no SYNC.

    The nodes are those read so far, simulated, selected, and *node_ids*.
    """
    from dvtcli.operations.results import SyncCheck

    sources = tuple(_source(node) for node in _nodes(session, node_ids))
    periods = [source.period_us for source in sources if source.period_us]
    listen_s = min(_LONGEST_S, max(_SHORTEST_S, 2e-6 * max(periods, default=0)))
    identifiers = {SYNC_BY_DEFAULT} | {(source.can_id, source.extended) for source in sources}
    received = sum((frame.can_id, frame.extended) in identifiers for frame in session.wire.receive(listen_s))
    checked = SyncCheck(sources, received, round(listen_s * 1000))
    text = "no known node produces SYNC, and synchronous PDOs wait for it"
    if checked.produced:
        return checked
    finding = warning("sync-producer", "0x1005:00", text, _start_of_sync(sources))
    return replace(checked, findings=(finding,))


def _start_of_sync(sources: Iterable[SyncSource]) -> Hint:
    """How to make a node the producer: preferably one whose period is set; and how to send SYNC once."""
    able = sorted((source for source in sources if source.cob_id is not None), key=lambda source: not source.period_us)
    sent = Hint(Action.SEND_SYNC, {"period": 20, "count": 100}, "sends SYNC from here")
    if not able or able[0].period_us is None:
        return sent
    first, node = able[0], {"node": able[0].node}
    produces = Hint(
        Action.WRITE, {**node, "object": "1005", "value": f"0x{(first.cob_id or 0) | _PRODUCES:08X}"},
        f"makes node {first.node} the producer",
    )  # fmt: skip
    if not first.period_us:
        period = Hint(Action.WRITE, {**node, "object": "1006", "value": "20000"}, "sets its period (µs)")
        produces = produces.after(period)
    return produces + replace(sent, why=", or {} sends SYNC from here")


def _nodes(session: SessionNodes, besides: Iterable[int]) -> list[Node]:
    network = session.network
    selected = session.selected_id()
    node_ids = {*network.nodes, *network.simulated_ids, *besides} | (set() if selected is None else {selected})
    return [session.node(node_id) for node_id in sorted(node_ids)]


def _source(node: ReadableNode) -> SyncSource:
    from dvtcli.operations.results import SyncSource

    return SyncSource(
        node.node_id, read_optional(node.sdo, COB_ID_SYNC, 0, 4), read_optional(node.sdo, CYCLE_PERIOD, 0, 4)
    )


_PRODUCES, _CAN_ID = 1 << 30, 0x7FF
_HEARTBEATS = range(0x701, 0x780)


@dataclass(slots=True)
class ShortFrames:
    """CAN-IDs and lengths of frames that may be SYNC: *received* from others, and *sent* by us."""

    received: set[int] = field(default_factory=set)
    sent: set[int] = field(default_factory=set)

    def note(self, frame: Frame, sent: bool) -> None:
        """Note *frame*; SYNC has no data, or a counter of one byte (CiA 301, 7.2.5)."""
        if len(frame.data) <= 1 and not frame.extended and not frame.remote and frame.can_id not in _HEARTBEATS:
            (self.sent if sent else self.received).add(frame.can_id)


@contextmanager
def short_frames(bus: CanopenBus) -> Iterator[ShortFrames]:
    """Collect short frames on *bus* during a block."""
    found = ShortFrames()
    end = bus.tap(found.note)
    try:
        yield found
    finally:
        end()


def unknown_syncs(frames: ShortFrames, nodes: Iterable[ReadableNode]) -> tuple[int, ...]:
    """Return CAN-IDs of received SYNC that neither *nodes* (0x1005, bit 30) nor we produce.

    Covers 0x080 and the CAN-IDs that *nodes* consume. Reads nothing without such frames.
    """
    strange = frames.received - frames.sent
    if not strange:
        return ()
    held: list[int] = []
    for node in nodes:
        with suppress(NoAnswer, SdoAborted, SdoProtocolError):  # who is silent explains nothing
            held.append(read_optional(node.read_cache, COB_ID_SYNC, 0, 4) or 0)
    explained = {value & _CAN_ID for value in held if value & _PRODUCES}
    meant = {SYNC_ID, *(value & _CAN_ID for value in held)}
    return tuple(sorted(strange & meant - explained))


def sync_note(can_id: int) -> str:
    """Describe the SYNC of an unknown producer."""
    text = can_id_text(can_id, extended=False)
    return f"SYNC {text} is received, but no node that was read produces it (0x1005): the producer is unknown"

"""`load`: what a network needs of its bus at worst, by its file or its nodes, and what is on the bus. Only reads.

Computes nothing itself, and says nothing to the user.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.network.bus_need import bus_need, fitting_bit_rates
from dvtcli.domain.network.frame_streams import WhatIf, streams_of
from dvtcli.domain.network.network_state import NetworkState
from dvtcli.domain.network.wanted_state import Endpoint
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.network_states import network_after, network_state
from dvtcli.operations.results.loads import Measured, NetworkLoad
from dvtcli.watch.frame_count import FrameCount

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.network.bus_need import BusNeed
    from dvtcli.domain.network.network_plan import NetworkPlan
    from dvtcli.operations.session import Session

#: What a bus runs at where nobody says, in bit/s: said with the answer.
USUAL_BIT_RATE = 500_000
MEASURED_S = 3.0
#: How long is listened to find nodes (s): most send a heartbeat once a second or faster.
HEARD_S = 1.2
_SLICE_S = 0.25
_HEARTBEATS = range(0x701, 0x780)
_OF_ONE_NODE = (range(0x081, 0x100), range(0x181, 0x200), range(0x281, 0x300), range(0x381, 0x400),
                range(0x481, 0x500), range(0x581, 0x600), _HEARTBEATS)  # fmt: skip


@dataclass(frozen=True, slots=True)
class LoadWishes:
    """What is asked of `load`.

    *for_s* is how long the bus is listened to (0: not at all), *bit_rate* (bit/s) counts instead of the bus's own.
    *sync_ms* and *emcy_ms* are periods that are to count, *inhibit* inhibit times in 100 µs by node-ID (None: the
    selected one) and TPDO.
    """

    for_s: float = MEASURED_S
    bit_rate: int | None = None
    sync_ms: float | None = None
    emcy_ms: float | None = None
    inhibit: Mapping[tuple[int | None, Pdo], int] = field(default_factory=dict)


def network_load(session: Session, file: str | None = None, wishes: LoadWishes | None = None) -> NetworkLoad:
    """What the nodes of the network *file*, else those on the bus, need at worst, and what the bus carries.

    Without a bus the file counts alone, its nodes as `described_network` has them; UsageError where there is neither.
    InputFileError with all that is wrong in the file.
    """
    wishes = wishes or LoadWishes()
    if file is None:
        _refuse_without_bus(session)
    measured = _measured(session, wishes.for_s) if _has_bus(session) else None
    state = _state(session, file, measured)
    told = wishes.bit_rate or (session.wire.bitrate if session.is_open else None) or session.options.bitrate
    bit_rate = told or USUAL_BIT_RATE
    found = streams_of(state, _what_if(session, state, wishes))
    bus = session.wire.name if measured is not None else ""
    return NetworkLoad(
        bus_need(found, bit_rate), fitting_bit_rates(found), file or "", bus, is_assumed=told is None, measured=measured
    )


def load_after(session: Session, plan: NetworkPlan) -> BusNeed | None:
    """What the nodes of *plan* need of the bus at worst once it is carried out; None where its bit rate is not known.

    Reads all of their PDOs. None, too, where one of them does not tell what it holds.
    """
    bit_rate = session.wire.bitrate or session.options.bitrate
    if bit_rate is None:
        return None
    try:
        state = network_state(session.node(one.node_id) for one in plan.nodes)
    except (NoAnswer, SdoAborted, SdoProtocolError):
        return None
    return bus_need(streams_of(network_after(state, plan)), bit_rate)


def live_state(session: Session) -> NetworkState:
    """What the nodes on the bus hold, with what only rules look at: those that are known, and those that are heard.

    UsageError where nobody chose a bus.
    """
    _refuse_without_bus(session)
    heard = None if session.network.simulated_ids else _measured(session, HEARD_S)
    return network_state(_answering(session, _present(session, heard)), for_rules=True)


def _has_bus(session: Session) -> bool:
    """Whether somebody chose a bus."""
    options = session.options
    return session.is_open or bool(options.sim or options.interface or options.channel or options.bus)


def _refuse_without_bus(session: Session) -> None:
    from dvtcli.operations.settings import NOBODY

    if not _has_bus(session) and session.chosen_by() == NOBODY:
        raise UsageError(
            "no FILE, and no bus", hint="give a network file, or a bus: -i socketcan -c can0, or --sim gen4"
        )
    session.open_network()


def _state(session: Session, file: str | None, measured: Measured | None) -> NetworkState:
    if file is None:
        return network_state(_answering(session, _present(session, measured)))
    if measured is None:
        from dvtcli.operations.described_network import described_network

        return described_network(file, session.tell)
    from dvtcli.files.network.file_log import FileLog
    from dvtcli.operations.network_wish import read_wish
    from dvtcli.operations.plan_network import plan_wish

    wish = read_wish(file)
    plan = plan_wish(session, wish, FileLog(file, Path(file).read_text("utf-8-sig")))
    return network_after(network_state(session.node(one.node_id) for one in plan.nodes), plan, wish)


def _present(session: Session, measured: Measured | None) -> list[int]:
    """The nodes that are known without asking, and those of which something was heard."""
    found = {*session.network.simulated_ids, *session.known_ids()}
    for can_id, extended in measured.count.by_id if measured is not None else ():
        if not extended and any(can_id in one for one in _OF_ONE_NODE):
            found.add(can_id & 0x7F)
    return sorted(found)


def _answering(session: Session, node_ids: Iterable[int]) -> list[Node]:
    """Those of *node_ids* that tell their PDOs; a word for each that does not."""
    nodes = []
    for node_id in node_ids:
        try:
            node = session.node(node_id)
            node.pdos()
            nodes.append(node)
        except (NoAnswer, SdoAborted, SdoProtocolError) as silent:
            session.tell.note(f"node {node_id} is not counted: {silent.text}")
    return nodes


def _measured(session: Session, for_s: float) -> Measured:
    """What passes on the bus within *for_s*."""
    bus = session.open_network().bus
    count = FrameCount()
    if not for_s or not bus.carries_frames:
        return Measured(count, 0.0)
    errors = bus.error_frame_count()
    lost = bus.lost_frame_count()
    untap = bus.tap(lambda frame, _sent: count.add(frame))
    begun_s = bus.now_s()
    try:
        while (left_s := begun_s + for_s - bus.now_s()) > 0:
            session.tell.progress("listening", round(10 * (for_s - left_s)), round(10 * for_s))
            bus.sleep(min(_SLICE_S, left_s))
    finally:
        untap()
    seconds = bus.now_s() - begun_s
    return Measured(count, seconds, bus.error_frame_count() - errors, bus.lost_frame_count() - lost)


def _what_if(session: Session, state: NetworkState, wishes: LoadWishes) -> WhatIf:
    inhibit: dict[Endpoint, int] = {}
    for (node_id, pdo), time in wishes.inhibit.items():
        ends = [Endpoint(node.node_id, pdo) for node in state.nodes if pdo in node.pdos]
        chosen = session.selected_id() if node_id is None and len(ends) > 1 else node_id
        ends = [end for end in ends if chosen is None or end.node_id == chosen]
        if len(ends) != 1:
            who = "" if node_id is None else f"{node_id}:"
            several_nodes = "which node's?" if ends else "no node here has it"
            raise UsageError(f"--inhibit {who}{pdo}: {several_nodes}", hint="NODE:tpdoN=MS, such as 5:tpdo3=40")
        inhibit[ends[0]] = time
    return WhatIf(_us(wishes.sync_ms), _us(wishes.emcy_ms), inhibit)


def _us(time_ms: float | None) -> int | None:
    return None if time_ms is None else round(time_ms * 1000)

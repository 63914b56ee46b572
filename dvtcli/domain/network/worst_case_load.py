"""Worst-case bus load of a network's frames, and whether each frame meets its deadline. Pure computation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple

from dvtcli.domain.can_ids import HEARTBEAT_BASE
from dvtcli.domain.cob_id import SYNC_BY_DEFAULT
from dvtcli.domain.frame import byte_length
from dvtcli.domain.frame_bits import least_frame_bits, most_frame_bits
from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.network.network_state import Identifier, NetworkState, NodeState, identifier_of
from dvtcli.domain.objects import COB_ID_TIME, CYCLE_PERIOD, GUARD_TIME, INHIBIT_TIME_EMCY, SYNC_OVERFLOW, SYNC_WINDOW
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.response_time import TimedFrame, response_times, utilisation
from dvtcli.domain.text import join_some, plural, some_nodes

#: The longest SDO frame: without period, and of lowest priority.
SDO_BITS = most_frame_bits(8)
#: The bit rates of CiA 301, in bit/s.
BIT_RATES = (10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
_SETTLES = 8


@dataclass(frozen=True, slots=True)
class StreamLoad:
    """A *stream* on the bus: its *share* (0 and up), and its worst-case response time (*response_us*).

    Both are None if unbounded.
    """

    stream: Stream
    share: Fraction | None
    response_us: Fraction | None

    @property
    def is_late(self) -> bool:
        """Whether the frame may miss its deadline; also if its response time is unbounded."""
        deadline = self.stream.deadline_us
        return deadline is not None and (self.response_us is None or self.response_us > deadline)

    @property
    def least_share(self) -> Fraction | None:
        """The share without stuff bits."""
        frame = self.stream.frame
        if self.share is None:
            return None
        return (
            self.share * least_frame_bits(frame.data_bytes, extended=frame.extended, remote=frame.remote) / frame.bits
        )


@dataclass(frozen=True, slots=True)
class WorstCaseLoad:
    """The load by all streams at *bit_rate* bit/s, by priority; *assumed* are the assumptions."""

    bit_rate: int
    needs: tuple[StreamLoad, ...]
    assumed: tuple[str, ...] = ()

    @property
    def limited(self) -> Fraction:
        """The share of all bounded streams."""
        return sum((need.share for need in self.needs if need.share is not None), Fraction(0))

    @property
    def least(self) -> Fraction:
        """The share of all bounded streams without stuff bits."""
        return sum((need.least_share for need in self.needs if need.least_share is not None), Fraction(0))

    @property
    def unlimited(self) -> tuple[Stream, ...]:
        """Streams without a frequency limit."""
        return tuple(need.stream for need in self.needs if need.share is None)

    @property
    def total(self) -> Fraction | None:
        """The worst-case load (0 and up); None if any stream is unbounded."""
        return None if self.unlimited else self.limited

    @property
    def late(self) -> tuple[StreamLoad, ...]:
        """Streams that may miss their deadline."""
        return tuple(need for need in self.needs if need.is_late)

    @property
    def fits(self) -> bool:
        """Whether all deadlines are met."""
        return not self.unlimited and not self.late


def worst_case_load(found: Streams, bit_rate: int) -> WorstCaseLoad:
    """The worst-case load of a bus by the streams *found* at *bit_rate* bit/s.

    Synchronous frames inherit SYNC's jitter: its delay beyond the shortest time on the wire.
    """
    streams = sorted(found.streams, key=lambda stream: stream.frame.arbitration)
    times = _response_times(streams, bit_rate)
    for _ in range(_SETTLES):
        late_us = _sync_jitter(streams, times, bit_rate)
        if late_us is None or all(stream.frame.jitter_us == late_us for stream in streams if stream.is_synchronous):
            break
        streams = [stream.late(late_us) if stream.is_synchronous else stream for stream in streams]
        times = _response_times(streams, bit_rate)
    shares = [None if stream.frame.period_us is None else utilisation([stream.frame], bit_rate) for stream in streams]
    needs = [StreamLoad(*row) for row in zip(streams, shares, times, strict=True)]
    return WorstCaseLoad(bit_rate, tuple(needs), found.assumed)


def _response_times(streams: list[Stream], bit_rate: int) -> list[Fraction | None]:
    return response_times([stream.frame for stream in streams], bit_rate, SDO_BITS)


def _sync_jitter(streams: list[Stream], times: list[Fraction | None], bit_rate: int) -> Fraction | None:
    """Jitter of SYNC in µs: latest minus earliest reception; None without SYNC, or if unbounded."""
    late = [
        time - Fraction(1_000_000 * least_frame_bits(one.frame.data_bytes, extended=one.frame.extended), bit_rate)
        for one, time in zip(streams, times, strict=True)
        if one.kind == "sync" and time is not None
    ]
    return max(late, default=None)


def fitting_bit_rates(found: Streams) -> tuple[int, ...]:
    """CiA 301 bit rates at which all *found* streams meet their deadlines."""
    return tuple(rate for rate in BIT_RATES if worst_case_load(found, rate).fits)


#: How far the clocks of two devices, and when frames come to be counted, may be apart; and frames beyond what a period
#: has room for: the first, and one that was late before it.
_CLOCKS, _AT_ENDS = 1.05, 2


def most_frames(streams: Iterable[Stream], seconds: float) -> int | None:
    """Maximum number of frames of *streams* within *seconds*; None if a stream is unbounded."""
    most = 0
    for stream in streams:
        if not stream.frame.period_us:
            return None
        most += int(_CLOCKS * seconds * 1_000_000 / stream.frame.period_us) + _AT_ENDS
    return most


Time = Fraction | int
SYNCHRONOUS = range(241)
ON_RTR = (252, 253)
EVENT_DRIVEN = (254, 255)
#: Assumed periods of a node's EMCY, and of the time stamp (µs).
EMCY_US, TIME_US = 1_000_000, 1_000_000
NO_LIMIT, NO_SYNC, UNKNOWN_TYPE = "any event", "unknown SYNC", "type unknown"


class Stream(NamedTuple):
    """A recurring frame: *kind* is `tpdo`, `rpdo`, `sync`, `heartbeat`, `guarding`, `emcy` or `time`.

    *label* names it, *node* is its sender. *why* explains its period, or why it has none. *deadline_us* counts from the
    planned transmission; *window_us* from SYNC, if the device has a window (0x1007). *assumed*: the period is an
    assumption.
    """

    kind: str
    label: str
    frame: TimedFrame
    why: str
    node: int | None = None
    pdo: Pdo | None = None
    deadline_us: Time | None = None
    window_us: int | None = None
    assumed: bool = False

    @property
    def is_synchronous(self) -> bool:
        """Whether SYNC triggers the frame."""
        return self.kind in ("tpdo", "rpdo") and self.why.startswith("SYNC")

    def late(self, jitter_us: Time) -> Stream:
        """The same stream, handed over up to *jitter_us* late."""
        deadline = self.deadline_us if self.window_us is None else self.window_us + jitter_us
        return self._replace(frame=self.frame._replace(jitter_us=jitter_us), deadline_us=deadline)


@dataclass(frozen=True, slots=True)
class WhatIf:
    """What-if values that replace the network's: *sync_us* and *emcy_us* (µs), inhibit times in 100 µs."""

    sync_us: int | None = None
    emcy_us: int | None = None
    inhibit: dict[Endpoint, int] = field(default_factory=dict)


class Streams(NamedTuple):
    """All streams, and the assumptions (*assumed*), each a sentence."""

    streams: tuple[Stream, ...]
    assumed: tuple[str, ...]


def in_ms(time_us: Time) -> str:
    """A time in text form: `2.5 ms`."""
    return f"{float(Fraction(time_us) / 1000):g} ms"


def without_producer(state: NetworkState) -> Iterator[tuple[NodeState, Pdo, PdoConfig]]:
    """Enabled RPDOs without a producer, one for each COB-ID."""
    seen: set[Identifier] = set()
    sent = {identifier_of(config) for _, _, config in state.enabled(is_tpdo=True)}
    for node, pdo, config in state.enabled(is_tpdo=False):
        if identifier_of(config) not in sent and identifier_of(config) not in seen:
            seen.add(identifier_of(config))
            yield node, pdo, config


def assumptions(state: NetworkState, streams: Iterable[Stream], what_if: WhatIf, sync_us: int | None) -> Iterator[str]:
    """Assumptions, and streams that are not counted, in words."""
    streams = list(streams)
    if emcys := sum(stream.kind == "emcy" and stream.assumed for stream in streams):
        whose = "node sends" if emcys == 1 else "nodes send"
        every = in_ms(what_if.emcy_us or EMCY_US)
        yield f"{emcys} {whose} an EMCY each {every} at most (0x1015 is 0, which sets no limit)"
    if any(stream.kind == "time" for stream in streams):
        yield f"TIME is sent each {in_ms(TIME_US)}"
    timers = [stream for stream in streams if stream.kind == "tpdo" and stream.why.startswith("timer")]
    if timers:
        verb = "is" if len(timers) == 1 else "are"
        what = f"{plural(len(timers), 'TPDO')} without inhibit time {verb}"
        yield f"{what} sent by the event timer only: {_names(timers)}"
    by_master = [stream for stream in streams if stream.kind == "rpdo"]
    if by_master:
        yield f"a master sends these PDOs on each SYNC: {_names(by_master)}"
    others = [row for row in without_producer(state) if not _counted(row[2], sync_us)]
    if others:
        listed = join_some(f"{node.node_id}:{pdo}" for node, pdo, _ in others)
        yield (
            f"no node of the network transmits what {listed} {'receives' if len(others) == 1 else 'receive'}: not "
            "counted"
        )
    asked = [f"{node.node_id}:{pdo}" for node, pdo, config in state.enabled(is_tpdo=True) if _is_asked(config)]
    if asked:
        yield f"sent on request (RTR) only, and not counted: {join_some(asked)}"
    if state.undescribed:
        nodes = some_nodes(state.undescribed)
        yield f"of {nodes} only the values of the file are known, 8 bytes a PDO if it says no length"
    yield "SDO uses the rest: an SDO frame may be under way when another frame becomes ready"


def _counted(config: PdoConfig, sync_us: int | None) -> bool:
    kind = config.communication.transmission_type
    return sync_us is not None and kind is not None and kind in SYNCHRONOUS


def _is_asked(config: PdoConfig) -> bool:
    return config.communication.transmission_type in ON_RTR


def _names(streams: Iterable[Stream]) -> str:
    return join_some(f"{stream.node}:{stream.pdo}" for stream in streams)


_MS, _100_US = 1000, 100
_LONGEST_BYTES = 8


def streams_of(state: NetworkState, what_if: WhatIf | None = None) -> Streams:
    """Streams of the nodes in *state* and its master, at their maximum."""
    what_if = what_if or WhatIf()
    sync_us = what_if.sync_us or min(state.sync_periods_us, default=None)
    found = [*_syncs(state, what_if), *_times(state)]
    takes: dict[Identifier, list[PdoConfig]] = {}
    for _, _, config in state.enabled(is_tpdo=False):
        takes.setdefault(identifier_of(config), []).append(config)
    for node in state.nodes:
        found += _tpdos(takes, node, sync_us, what_if)
        found += _error_control(state, node)
        found += _emcy(node, what_if)
    found += _master(state, sync_us)
    return Streams(tuple(found), tuple(assumptions(state, found, what_if, sync_us)))


def _frame(identifier: Identifier, data_bytes: int, period_us: Time | None, *, remote: bool = False) -> TimedFrame:
    return TimedFrame(identifier[0], data_bytes, period_us or None, extended=identifier[1], remote=remote)


def _syncs(state: NetworkState, what_if: WhatIf) -> Iterator[Stream]:
    producers = [node for node in state.nodes if node.produces_sync]
    for node in producers:
        told_us = node.number(CYCLE_PERIOD) or 0
        yield _sync(node.sync, int((node.number(SYNC_OVERFLOW) or 0) > 1), what_if.sync_us or told_us, node.node_id)
    identifier = next((node.sync for node in (*producers, *state.nodes)), SYNC_BY_DEFAULT)
    by_master = None if state.master is None else state.master.sync_period_us
    if by_master:
        yield _sync(identifier, 0, what_if.sync_us or by_master, None)
    elif what_if.sync_us and not producers:
        yield _sync(identifier, 0, what_if.sync_us, None)


def _sync(identifier: Identifier, data_bytes: int, period_us: int, node: int | None) -> Stream:
    why = f"every {in_ms(period_us)}"
    return Stream("sync", "SYNC", _frame(identifier, data_bytes, period_us), why, node, deadline_us=period_us)


def _times(state: NetworkState) -> Iterator[Stream]:
    for node in state.nodes:
        if node.produces(COB_ID_TIME):
            frame = _frame(node.time, 6, TIME_US)
            yield Stream("time", "TIME", frame, "assumed", node.node_id, deadline_us=TIME_US, assumed=True)


def _tpdos(
    takes: Mapping[Identifier, Sequence[PdoConfig]], node: NodeState, sync_us: int | None, what_if: WhatIf
) -> Iterator[Stream]:
    """Streams of the node's TPDOs; *takes* are all enabled RPDOs by CAN-ID."""
    for pdo, config in sorted(node.pdos.items()):
        kind = config.communication.transmission_type
        if not pdo.is_tpdo or not config.enabled or kind in ON_RTR:
            continue
        end = Endpoint(node.node_id, pdo)
        inhibit = what_if.inhibit.get(end, config.communication.inhibit_time or 0) * _100_US
        period_us, why = _period(kind, inhibit, (config.communication.event_timer or 0) * _MS, sync_us)
        window = (node.number(SYNC_WINDOW) or None) if kind in SYNCHRONOUS else None
        deadline = (
            None if period_us is None else min([period_us, *_waits(takes.get(identifier_of(config), ()), period_us)])
        )
        frame = _frame(identifier_of(config), data_bytes(config), period_us)
        yield Stream(
            kind="tpdo",
            label=pdo.label,
            frame=frame,
            why=why,
            node=node.node_id,
            pdo=pdo,
            deadline_us=deadline,
            window_us=window,
        )


def data_bytes(config: PdoConfig) -> int:
    """Bytes of a PDO on the wire; 8 if unknown."""
    if config.mpdo is not None or config.inconsistency:
        return _LONGEST_BYTES
    return min(byte_length(config.bits), _LONGEST_BYTES)


def _period(kind: int | None, inhibit_us: int, timer_us: int, sync_us: int | None) -> tuple[Time | None, str]:
    """Minimum period of a TPDO by its transmission type, and the reason."""
    if kind is not None and kind in SYNCHRONOUS:
        times = max(kind, 1)
        words = f"SYNC, every {times}" if times > 1 else "SYNC"
        return (None, NO_SYNC) if sync_us is None else (times * sync_us, words)
    if inhibit_us:
        return inhibit_us, f"inhibit {in_ms(inhibit_us)}"
    if timer_us:
        return timer_us, f"timer {in_ms(timer_us)}"
    if kind is None:
        return None, UNKNOWN_TYPE
    return None, NO_LIMIT if kind in EVENT_DRIVEN else f"type {kind}"


def _waits(consumers: Sequence[PdoConfig], period_us: Time) -> Iterator[Time]:
    """Consumers' event timers (RPDO deadlines) in excess of the period, in µs."""
    for received in consumers:
        patience_us = (received.communication.event_timer or 0) * _MS
        if patience_us > period_us:
            yield patience_us - period_us


def _error_control(state: NetworkState, node: NodeState) -> Iterator[Stream]:
    identifier = (HEARTBEAT_BASE + node.node_id, False)
    if node.heartbeat_ms:
        yield _heartbeat(state, node.node_id, node.heartbeat_ms)
    elif node.is_guarded:
        period_us = (node.number(GUARD_TIME) or 0) * _MS
        why = f"guard time {in_ms(period_us)}"
        for label, remote in (("guarding, asked", True), ("guarding", False)):
            frame = _frame(identifier, int(not remote), period_us, remote=remote)
            yield Stream("guarding", label, frame, why, node.node_id, deadline_us=period_us)


def _heartbeat(state: NetworkState, node_id: int, every_ms: int) -> Stream:
    """A heartbeat stream; its deadline is the period, or less if a consumer waits less beyond the period."""
    watches = (node.watched.get(node_id, 0) - every_ms for node in state.nodes)
    deadline_ms = min([every_ms, *(left for left in watches if left > 0)])
    frame = _frame((HEARTBEAT_BASE + node_id, False), 1, every_ms * _MS)
    why = f"every {every_ms} ms"
    return Stream("heartbeat", "heartbeat", frame, why, node_id, deadline_us=deadline_ms * _MS)


def _emcy(node: NodeState, what_if: WhatIf) -> Iterator[Stream]:
    identifier = node.emcy
    if identifier is None:
        return
    inhibit_us = (node.number(INHIBIT_TIME_EMCY) or 0) * _100_US
    period_us = inhibit_us or what_if.emcy_us or EMCY_US
    why = f"0x1015, {in_ms(inhibit_us)}" if inhibit_us else "assumed"
    frame = _frame(identifier, _LONGEST_BYTES, period_us)
    yield Stream("emcy", "EMCY", frame, why, node.node_id, deadline_us=period_us, assumed=not inhibit_us)


def _master(state: NetworkState, sync_us: int | None) -> Iterator[Stream]:
    """Streams of a master: its heartbeat, and with each SYNC the synchronous RPDOs without another producer."""
    master = state.master
    if master is not None and master.node_id and master.node_id <= 127 and master.heartbeat_producer_ms:
        yield _heartbeat(state, master.node_id, master.heartbeat_producer_ms)
    for node, pdo, config in without_producer(state):
        kind = config.communication.transmission_type
        if sync_us is not None and kind is not None and kind in SYNCHRONOUS:
            frame = _frame(identifier_of(config), data_bytes(config), sync_us)
            yield Stream(
                kind="rpdo",
                label=pdo.label,
                frame=frame,
                why="SYNC",
                node=node.node_id,
                pdo=pdo,
                deadline_us=sync_us,
                assumed=True,
            )

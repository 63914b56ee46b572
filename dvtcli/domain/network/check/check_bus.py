"""Rules about the bus load: limits of each TPDO, and deadlines."""

from __future__ import annotations

from fractions import Fraction

from dvtcli.domain.frame_bits import most_frame_bits
from dvtcli.domain.lint import ERROR, NOTE, WARNING, check
from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetFound, NetSpot, at
from dvtcli.domain.network.network_state import NodeState
from dvtcli.domain.network.worst_case_load import EVENT_DRIVEN, WorstCaseLoad, data_bytes
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.rules import communication

_TIMES = "CiA 301, 7.5.2.37: inhibit time, event timer"
_ANALYSIS = "Davis, Burns, Bril, Lukkien 2007"
#: Limits (share of the bit rate) for the inhibit time proposals together, and for a busy bus.
_FOR_EVENTS, _BUSY = Fraction(5, 100), Fraction(8, 10)
#: Proposed inhibit times, in ms.
_PROPOSED = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000)


def _readable(network: CheckedNetwork) -> list[tuple[NodeState, Pdo, PdoConfig]]:
    """TPDOs whose times and mapping are known: of others it is not known how often they come."""
    return [found for found in network.tpdos if found[2].has_mapping and not found[2].untold]


def _unlimited(network: CheckedNetwork) -> list[NetSpot]:
    return [
        at(node, pdo)
        for node, pdo, config in _readable(network)
        if config.communication.transmission_type in EVENT_DRIVEN
        and not config.communication.inhibit_time
        and not config.communication.event_timer
    ]


@check(
    "unbounded-event-pdo",
    WARNING,
    "an event-driven TPDO has neither inhibit time nor event timer: its bus load depends on its values",
    _TIMES,
)
def unbounded_event_pdo(network: CheckedNetwork) -> NetFound:
    """A noisy value is sent as fast as possible: on one robot, such a PDO took three quarters of the bus."""
    spots = frozenset(_unlimited(network))
    for node, pdo, config in network.tpdos:
        if at(node, pdo) not in spots:
            continue
        if network.bit_rate is None:
            yield at(node, pdo), "no inhibit time, no event timer"
            continue
        bits = most_frame_bits(data_bytes(config), extended=config.communication.cob_id.extended)
        share = _FOR_EVENTS / len(spots)
        needed_ms = Fraction(1000 * bits) / (share * network.bit_rate)
        time_ms = next((proposed_ms for proposed_ms in _PROPOSED if proposed_ms >= needed_ms), _PROPOSED[-1])
        taken = Fraction(100_000 * bits, time_ms * network.bit_rate)
        yield (
            at(node, pdo),
            f"no inhibit time, no event timer; {time_ms} ms would limit it to {float(taken):.1f} %",
        )


@check("timer-without-inhibit", NOTE, "an event-driven TPDO has an event timer, but no inhibit time", _TIMES)
def timer_without_inhibit(network: CheckedNetwork) -> NetFound:
    """A device that also sends on each change is unlimited; many devices send by the timer only."""
    for node, pdo, config in _readable(network):
        held = config.communication
        if held.transmission_type in EVENT_DRIVEN and held.event_timer and not held.inhibit_time:
            yield at(node, pdo), f"its event timer is {held.event_timer} ms, its inhibit time 0"


@check("timer-below-inhibit", WARNING, "the event timer of a TPDO is shorter than its inhibit time", _TIMES)
def timer_below_inhibit(network: CheckedNetwork) -> NetFound:
    """The inhibit time wins."""
    for node, pdo, config in network.tpdos:
        if text := communication.timer_below_inhibit(config.communication):
            yield at(node, pdo), text


@check("bus-overload", ERROR, "the worst-case load of the frames that have a limit is over 100 %", _ANALYSIS)
def bus_overload(network: CheckedNetwork) -> NetFound:
    """Frames of low priority are never sent."""
    if network.need is not None and network.need.limited > 1:
        yield NetSpot(), _share(network.need)


@check("busy-bus", WARNING, "the frames that have a limit need more than 80 % of the bus at worst",
       "ours; bus monitors advise it for traffic that is not cyclic")  # fmt: skip
def busy_bus(network: CheckedNetwork) -> NetFound:
    """Frames of low priority wait long."""
    if network.need is not None and _BUSY < network.need.limited <= 1:
        yield NetSpot(), _share(network.need)


@check("too-late", ERROR, "the worst-case response time of a frame exceeds its deadline", _ANALYSIS)
def too_late(network: CheckedNetwork) -> NetFound:
    """The next frame is due by then, or a consumer has timed out."""
    for need in () if network.need is None else network.need.late:
        stream = need.stream
        is_said = stream.window_us is not None or need.response_us is None
        if is_said or stream.deadline_us is None or need.response_us is None:
            continue  # SYNC's window, and what has no bound, have rules of their own
        times = (
            f"{float(need.response_us) / 1000:.2f} ms at worst, {float(stream.deadline_us) / 1000:g} ms is the deadline"
        )
        yield NetSpot(stream.node, stream.pdo), f"{stream.label} takes {times}"


#: Names of the rules that need a known bit rate.
CHECKS_OF_BIT_RATE = frozenset({"bus-overload", "busy-bus", "too-late", "sync-window"})


def _share(need: WorstCaseLoad) -> str:
    share = f"{100 * float(need.limited):.1f} %"
    return f"{share} of {need.bit_rate / 1000:g} kbit/s in the worst case; the bus load table shows the shares"


@check("unknown-bit-rate", NOTE, "the bit rate is not known: load and deadlines are not checked", _ANALYSIS)
def unknown_bit_rate(network: CheckedNetwork) -> NetFound:
    """A load too high for a slow bus may fit a fast bus."""
    if network.bit_rate is None and network.streams.streams:
        what = "add master: {baudrate: …} (kbit/s)" if network.state.file else "give the bit rate (bit/s)"
        yield NetSpot(), f"unknown bit rate: load and deadlines were not checked; {what}"

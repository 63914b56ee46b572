"""Which frames a network sends at most, and what they need of the bus."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import pytest

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.network.network_config import Endpoint, MasterRole
from dvtcli.domain.network.network_state import NetworkState, NodeState
from dvtcli.domain.network.worst_case_load import Stream, WhatIf, fitting_bit_rates, streams_of, worst_case_load
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry

TPDO1, TPDO2, RPDO1 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2"), Pdo.parse("rpdo1")


def pdo(can_id: int, kind: int | None = 255, inhibit: int = 0, timer: int = 0, bits: int = 32) -> PdoConfig:
    """An enabled PDO of *bits* bits; inhibit time in 100 µs, event timer in ms."""
    entries = tuple(PdoMappingEntry(0x2000, number, 8) for number in range(bits // 8))
    return PdoConfig(PdoCommunicationParameter(CobId(can_id), kind, inhibit, timer), entries)


def node(node_id: int = 1, pdos: dict[Pdo, PdoConfig] | None = None, **numbers: int) -> NodeState:
    """A node; objects as `x1017=500`."""
    held = {(int(name[1:5], 16), int(name[6:] or "0")): value for name, value in numbers.items()}
    return NodeState(node_id, pdos=pdos or {}, numbers=held)


def one(state: NetworkState, kind: str, what_if: WhatIf | None = None) -> Stream:
    """The only stream of *kind*."""
    (found,) = [stream for stream in streams_of(state, what_if).streams if stream.kind == kind]
    return found


@pytest.mark.parametrize(
    ("config", "period_us", "why"),
    [
        (pdo(0x181, 255, inhibit=100), 10_000, "inhibit 10 ms"),
        (pdo(0x181, 255, inhibit=100, timer=5), 10_000, "inhibit 10 ms"),
        (pdo(0x181, 254, timer=5), 5_000, "timer 5 ms"),
        (pdo(0x181, 255), None, "any event"),
        (pdo(0x181, None), None, "type unknown"),
        (pdo(0x181, 241), None, "type 241"),
        (pdo(0x181, 0), 4_000, "SYNC"),
        (pdo(0x181, 1, inhibit=900), 4_000, "SYNC"),
        (pdo(0x181, 240), 960_000, "SYNC, every 240"),
    ],
)
def test_how_often_a_tpdo_comes_at_most(config: PdoConfig, period_us: int | None, why: str) -> None:
    state = NetworkState((node(1, {TPDO1: config}, x1005=0x4000_0080, x1006=4000),))
    found = one(state, "tpdo")
    assert (found.frame.period_us, found.why, found.deadline_us) == (period_us, why, period_us)


def test_a_synchronous_tpdo_without_a_known_sync_has_no_limit() -> None:
    state = NetworkState((node(1, {TPDO1: pdo(0x181, 1)}, x1005=0x80, x1006=4000),))
    assert one(state, "tpdo").frame.period_us is None
    assert one(state, "tpdo", WhatIf(sync_us=2000)).frame.period_us == 2000
    assert one(NetworkState(state.nodes, MasterRole(sync_period_us=8000)), "tpdo").frame.period_us == 8000


def test_what_is_off_or_asked_for_is_not_sent() -> None:
    off = PdoConfig(PdoCommunicationParameter(CobId(0x181, valid=False), 255), ())
    found = streams_of(NetworkState((node(1, {TPDO1: off, TPDO2: pdo(0x281, 253)}),)))
    assert found.streams == ()
    assert "sent on request (RTR) only, and not counted: 1:tpdo2" in found.assumed


def test_error_control_emcy_and_time() -> None:
    beats = NetworkState((node(1, x1017=500), node(2, x1016_01=0x0001_0700)))
    beat = one(beats, "heartbeat")
    assert (beat.frame.can_id, beat.frame.bits, beat.deadline_us) == (0x701, 65, 500_000)
    assert one(NetworkState((node(1, x1017=500), node(2, x1016_01=0x0001_0258))), "heartbeat").deadline_us == 100_000
    guarded = streams_of(NetworkState((node(3, x100C=100, x100D=3),))).streams
    assert [(stream.frame.remote, stream.frame.bits) for stream in guarded] == [(True, 55), (False, 65)]
    assert one(NetworkState((node(1, x1014=0x81, x1015=50),)), "emcy").frame.period_us == 5000
    assumed = one(NetworkState((node(1, x1014=0x81),)), "emcy")
    assert (assumed.frame.period_us, assumed.assumed) == (1_000_000, True)
    assert streams_of(NetworkState((node(1, x1014=0x8000_0081),))).streams == ()
    assert one(NetworkState((node(1, x1012=0x4000_0100),)), "time").frame.bits == 115


def test_a_consumer_that_gives_up_sooner_sets_the_deadline() -> None:
    sender = node(1, {TPDO1: pdo(0x181, inhibit=100)})
    patient, hasty = (node(2, {RPDO1: pdo(0x181, timer=timer)}) for timer in (100, 12))
    assert one(NetworkState((sender, patient)), "tpdo").deadline_us == 10_000
    assert one(NetworkState((sender, hasty)), "tpdo").deadline_us == 2_000


def test_synchronous_rpdos_that_no_node_feeds_are_the_masters() -> None:
    state = NetworkState((node(5, {RPDO1: pdo(0x205, 1)}),), MasterRole(sync_period_us=10_000))
    assert one(state, "rpdo").frame.period_us == 10_000
    said = "\n".join(streams_of(state).assumed)
    assert "a master sends these PDOs on each SYNC: 5:rpdo1" in said
    assert "not counted" not in said
    unsynchronised = streams_of(NetworkState(state.nodes)).assumed
    assert "no node of the network transmits what 5:rpdo1 receives: not counted" in unsynchronised
    fed = NetworkState((*state.nodes, node(6, {TPDO1: pdo(0x205, timer=10)})), state.master)
    assert not [stream for stream in streams_of(fed).streams if stream.kind == "rpdo"]
    event = streams_of(NetworkState((node(5, {RPDO1: pdo(0x205)}),)))
    assert "no node of the network transmits what 5:rpdo1 receives: not counted" in event.assumed


def test_an_inhibit_time_that_somebody_tries() -> None:
    state = NetworkState((node(1, {TPDO1: pdo(0x181)}),))
    tried = one(state, "tpdo", WhatIf(inhibit={Endpoint(1, TPDO1): 400}))
    assert tried.frame.period_us == 40_000


def test_one_without_limit_leaves_no_total_and_no_bound_behind_it() -> None:
    both = {TPDO1: pdo(0x181), TPDO2: pdo(0x281, timer=10, bits=64)}
    need = worst_case_load(streams_of(NetworkState((node(1, both),))), 500_000)
    assert need.total is None
    assert not need.fits
    assert need.limited == Fraction(135, 5000)
    assert [(row.share, row.response_us) for row in need.needs] == [(None, None), (Fraction(27, 1000), None)]
    assert fitting_bit_rates(streams_of(NetworkState((node(1, both),)))) == ()


def test_sync_is_late_and_so_is_what_it_triggers() -> None:
    """135 bits of another frame and 55 of SYNC, of which 47 are the least: 143 bits of jitter."""
    state = NetworkState((node(1, {TPDO1: pdo(0x181, 1)}, x1005=0x4000_0080, x1006=10_000, x1007=2000),))
    sync, sent = worst_case_load(streams_of(state), 500_000).needs
    assert (sync.response_us, sync.stream.frame.jitter_us) == (380, 0)
    assert sent.stream.frame.jitter_us == 286
    assert sent.response_us == 286 + (135 + 55 + 95) * 2
    assert sent.stream.deadline_us == 2000 + 286
    assert not sent.is_late


def test_synchronous_pdos_that_do_not_fit_their_window_are_late() -> None:
    numbers: dict[str, Any] = {"x1005": 0x4000_0080, "x1006": 10_000, "x1007": 1000}
    pdos = {Pdo.parse(f"tpdo{number}"): pdo(0x181 + 0x100 * number, 1, bits=64) for number in range(1, 5)}
    need = worst_case_load(streams_of(NetworkState((node(1, pdos, **numbers),))), 500_000)
    assert [row.is_late for row in need.needs] == [False, False, False, True, True]


def test_a_bus_that_is_too_slow() -> None:
    state = NetworkState((node(1, {TPDO1: pdo(0x181, inhibit=10, bits=64)}),))
    need = worst_case_load(streams_of(state), 125_000)
    assert need.total == Fraction(108, 100)
    assert [row.stream.label for row in need.late] == ["TPDO1"]
    assert fitting_bit_rates(streams_of(state)) == (500_000, 800_000, 1_000_000)


def test_a_frame_in_time_to_the_microsecond_is_not_late() -> None:
    state = NetworkState((node(1, {TPDO1: pdo(0x181, inhibit=10, bits=64)}),))
    (row,) = worst_case_load(streams_of(state), 500_000).needs
    assert row.stream.deadline_us == 1000
    assert not replace(row, response_us=Fraction(1000)).is_late
    assert replace(row, response_us=Fraction(1001)).is_late
    assert replace(row, response_us=None).is_late


def test_a_tpdo_that_only_its_event_timer_limits_is_named() -> None:
    pdos = {TPDO1: pdo(0x181, timer=20), TPDO2: pdo(0x281, inhibit=100, timer=20)}
    said = "1 TPDO without inhibit time is sent by the event timer only: 1:tpdo1"
    assert said in streams_of(NetworkState((node(1, pdos),))).assumed
    limited = streams_of(NetworkState((node(1, {TPDO2: pdos[TPDO2]}),))).assumed
    assert "event timer" not in "\n".join(limited)

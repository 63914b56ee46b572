"""Each rule of `check` finds what is planted for it, and says nothing of a sound network."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import pytest

from dvtcli.domain.lint import ERROR
from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetSpot, judged_pdos, mark_of
from dvtcli.domain.network.check.network_rules import NETWORK_RULES, network_findings
from dvtcli.domain.network.network_config import NOWHERE, Mark
from dvtcli.domain.network.network_state import NetworkState
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.ports import Frame
from tests.domain.network_check.planted import (
    BIT_RATE,
    PLANTED,
    R1,
    R2,
    SOUND,
    T1,
    T2,
    Change,
    Planted,
    also,
    concise,
    entry,
    has,
    hears,
    holds,
    lacks,
    master,
    node,
    pdo,
)
from tests.harness.sample import heavy

_WIDE = pdo(0x1AB, entry(0x6041), extended=True)

ALL = {rule.name for rule in NETWORK_RULES}


def found(state: NetworkState) -> list[str]:
    """The names of the rules that find something in *state*."""
    return [rule.name for rule, _, _ in network_findings(CheckedNetwork(state, BIT_RATE), ALL)]


def test_of_a_sound_network_nothing_is_said() -> None:
    assert [text for _, _, text in network_findings(CheckedNetwork(SOUND, BIT_RATE), ALL)] == []
    there = CheckedNetwork(SOUND, BIT_RATE, hears()(), frozenset({1, 5, 10}))
    assert [text for _, _, text in network_findings(there, ALL)] == []


def test_a_concise_dcf_that_makes_what_a_node_is_to_hold_is_right() -> None:
    """The last value of an object counts: a PDO is disabled, set up, and enabled again."""
    steps = ((0x1800, 1, 4, 0x8000_0185), (0x1A00, 0, 1, 0), (0x1A00, 1, 4, 0x6040_0010), (0x1A00, 2, 4, 0x6061_0008),
             (0x1A00, 0, 1, 2), (0x1800, 1, 4, 0x185), (0x1017, 0, 2, 500), (0x2000, 0, 1, 9))  # fmt: skip
    state = node(10, downloads={5: concise(*steps)})(SOUND)
    assert [text for _, _, text in network_findings(CheckedNetwork(state, BIT_RATE), ALL)] == []


@pytest.mark.parametrize("planted", PLANTED, ids=[f"{n}-{one.rule}" for n, one in enumerate(PLANTED)])
def test_a_planted_fault_is_found(planted: Planted) -> None:
    network = planted.network
    alone = list(network_findings(network, {planted.rule}))
    assert alone
    assert all(rule.name == planted.rule and text for rule, _, text in alone)
    at_nodes = {node.node_id for node in network.nodes} | set(planted.present or ())
    assert {spot.node_id for _, spot, _ in alone} <= at_nodes | {None}


def test_every_rule_has_a_planted_fault() -> None:
    planted = Counter(one.rule for one in PLANTED)
    assert planted.keys() == ALL
    assert len(PLANTED) >= 60
    assert len(ALL) >= 40
    assert len(NETWORK_RULES) == len(ALL)


@heavy
def test_most_faults_are_found_by_few_rules() -> None:
    """A fault is not drowned by what follows from it."""
    counts = [len({rule.name for rule, _, _ in network_findings(one.network, ALL)}) for one in PLANTED]
    assert sum(counts) / len(counts) < 3


def test_nothing_is_held_against_a_node_that_nobody_knows() -> None:
    """Without an EDS only what is there counts, never what is missing."""
    bare = NetworkState(SOUND.nodes[:2], undescribed=(1, 5))
    names = set(found(bare)) - {"sync-from-elsewhere"}
    assert not names


def test_a_limit_that_is_proposed_limits() -> None:
    planted = next(one for one in PLANTED if one.rule == "unbounded-event-pdo")
    rule = next(one for one in NETWORK_RULES if one.name == "unbounded-event-pdo")
    ((_, spot, text),) = network_findings(CheckedNetwork(planted.change(SOUND), 125_000), {rule.name})
    assert (spot.node_id, str(spot.pdo)) == (5, "tpdo1")
    assert text == "no inhibit time, no event timer; 20 ms would limit it to 3.4 %"


def test_rules_say_who_says_so() -> None:
    for rule in NETWORK_RULES:
        assert rule.sense
        assert rule.source
    assert sum(rule.severity is ERROR for rule in NETWORK_RULES) >= 30


@pytest.mark.parametrize(
    ("rule", "change", "wanted"),
    [
        ("one-producer", also(has(1, T2, _WIDE), has(5, T2, _WIDE)), "0x000001AB"),
        ("emcy-twice", also(holds(1, x1014=0x2000_00A0), holds(5, x1014=0x2000_00A0)), "0x000000A0"),
        ("sync-ids-differ", holds(5, x1005=0x2000_0090), "0x00000090"),
        ("time-ids-differ", also(holds(10, x1012=0x6000_0100), holds(5, x1012=0x8000_0110)), "0x00000100"),
        ("from-nobody", hears(Frame(0x1AB, bytes(8), extended=True, timestamp_s=2)), "0x000001AB"),
    ],
)
def test_a_can_id_of_29_bits_has_eight_digits(rule: str, change: Any, wanted: str) -> None:
    planted = Planted(rule, received=change) if rule == "from-nobody" else Planted(rule, change)
    texts = [text for _, _, text in network_findings(planted.network, {rule})]
    assert any(wanted in text for text in texts), texts


_ABSENT = pdo(0x333, entry(0x6099), inhibit=1000)


@pytest.mark.parametrize(
    ("config", "named", "judged"),
    [
        (_ABSENT, False, True),
        (_ABSENT.disabled(), False, False),
        (_ABSENT.disabled(), True, True),
        (replace(_ABSENT, unread=((0x1A01, 2),)), True, False),
        (replace(_ABSENT, mpdo=0xFF), True, False),
    ],
    ids=["enabled", "disabled", "disabled, but named", "inconsistent", "multiplexed"],
)
def test_a_pdo_is_judged_if_it_is_enabled_or_named_and_whole(config: PdoConfig, named: bool, judged: bool) -> None:
    state = also(has(5, T2, config), node(5, marks={T2: Mark(7)} if named else {}))(SOUND)
    assert any(which == T2 for which, _ in judged_pdos(state.nodes[1])) is judged


def test_a_finding_about_a_mapping_is_at_its_entry() -> None:
    """The sub-index in a finding's place is hexadecimal."""
    entries = (*[entry(0x6061, 4)] * 15, entry(0x6099, 4))
    planted = Planted("object-exists", has(5, T2, pdo(0x333, *entries, inhibit=1000)))
    assert [spot for _, spot, _ in network_findings(planted.network, {"object-exists"})] == [NetSpot(5, T2, 0x1A01, 16)]


@pytest.mark.parametrize(
    ("spot", "line"),
    [
        (NetSpot(), 0), (NetSpot(99), 0), (NetSpot(5), 3), (NetSpot(5, T1), 4), (NetSpot(5, T2), 3),
        (NetSpot(5, None, 0x1017), 9), (NetSpot(5, None, 0x1017, 1), 3), (NetSpot(5, T1, 0x1800, 5), 6),
    ],
)  # fmt: skip
def test_the_place_in_the_file_is_that_of_the_object_the_pdo_or_the_node(spot: NetSpot, line: int) -> None:
    places = {(0x1017, 0): Mark(9), (0x1800, 5): Mark(6)}
    state = node(5, mark=Mark(3), marks={T1: Mark(4)}, places=places)(SOUND)
    assert mark_of(state, spot) == (Mark(line) if line else NOWHERE)


def _synchronous(takes: int, sends: int) -> Change:
    """A TPDO of transmission type *sends* for an RPDO of type *takes*."""
    return also(
        has(1, T1, pdo(0x181, entry(0x6040), entry(0x6071), kind=sends)),
        has(5, R1, pdo(0x181, entry(0x6040), entry(0x6071), kind=takes)),
    )


_PARTS = pdo(0x181, entry(0x6060, 8), entry(5, 8), entry(0x6071), kind=1)
_STATUS_ONLY = entry(0x6041)


@pytest.mark.parametrize(
    ("rule", "change", "said"),
    [
        ("too-long", has(5, T2, pdo(0x333, *[_STATUS_ONLY] * 4)), ""),
        ("too-long", has(5, T2, pdo(0x333, *[_STATUS_ONLY] * 4, entry(5, 1))), "65 bits"),
        ("synchronous-consumer", _synchronous(240, 254), "type 240"),
        ("synchronous-consumer", _synchronous(0, 255), "type 255"),
        ("synchronous-consumer", _synchronous(241, 254), ""),  # 241 to 251 are reserved
        ("synchronous-consumer", _synchronous(240, 253), ""),  # sent on request
        ("frame-format", has(5, R2, pdo(0x181, entry(0x6042), extended=True)), "waits for 29 bits, 0x181 is sent"),
        ("frame-format", also(has(1, T2, pdo(0x2AB, _STATUS_ONLY, extended=True)),
                              has(5, R2, pdo(0x2AB, entry(0x6042)))), "waits for 11 bits, 0x000002AB is sent"),
        ("frame-format", also(has(1, T2, pdo(0x2AB, _STATUS_ONLY, extended=True)),
                              has(5, R2, pdo(0x2AB, entry(0x6042), extended=True))), ""),
        ("frame-format", has(5, R2, pdo(0x2AB, entry(0x6042))), ""),
        ("takes-nothing", has(5, R1, pdo(0x181)), "maps nothing"),
        ("takes-nothing", has(5, R1, pdo(0x181, entry(6))), "maps dummies only"),
        ("part-of-object", has(5, R1, _PARTS), "8 of the 16 bits"),
        ("part-of-object", also(has(5, R1, _PARTS), node(5, unresolved=frozenset({R1}))), ""),
        ("part-of-object", also(has(5, R1, _PARTS), node(1, unresolved=frozenset({T1}))), ""),
        ("part-of-object", has(5, R1, replace(_PARTS, unread=((0x1600, 4),))), ""),
        ("part-of-object", has(5, R1, replace(_PARTS, mpdo=0xFF)), ""),
    ],
)  # fmt: skip
def test_a_rule_begins_where_the_standard_says(rule: str, change: Change, said: str) -> None:
    texts = [text for _, _, text in network_findings(Planted(rule, change).network, {rule})]
    assert len(texts) == bool(said), texts
    assert said in "".join(texts)


def _tpdo(number: int, can_id: int, node_id: int = 5, **more: Any) -> Change:
    """A further TPDO of node *node_id*."""
    return has(node_id, Pdo.parse(f"tpdo{number}"), pdo(can_id, _STATUS_ONLY, inhibit=1000, **more))


def _counts(producer: int, start: int) -> Change:
    """A SYNC counter that overflows at *producer*, and a TPDO that waits for it to be *start*."""
    waits = has(1, T1, pdo(0x181, entry(0x6040), entry(0x6071), kind=1, start=start))
    return also(holds(10, x1019=producer), waits)


_OTHER_ID = also(node(10, node_id=37), _tpdo(5, 0x1A5))


@pytest.mark.parametrize(
    ("rule", "change", "said"),
    [
        ("reserved-type", _tpdo(2, 0x333, kind=240), ""),
        ("reserved-type", _tpdo(2, 0x333, kind=241), "type 241"),
        ("reserved-type", _tpdo(2, 0x333, kind=251), "type 251"),
        ("reserved-type", _tpdo(2, 0x333, kind=252), ""),
        ("reserved-type", has(5, R2, pdo(0x333, entry(0x6042), kind=240)), ""),
        ("reserved-type", has(5, R2, pdo(0x333, entry(0x6042), kind=241)), "type 241"),
        ("reserved-type", has(5, R2, pdo(0x333, entry(0x6042), kind=253)), "type 253"),
        ("reserved-type", has(5, R2, pdo(0x333, entry(0x6042), kind=254)), ""),
        ("sent-on-request", _tpdo(2, 0x333, kind=251), ""),
        ("sent-on-request", _tpdo(2, 0x333, kind=252), "RTR"),
        ("sent-on-request", _tpdo(2, 0x333, kind=253), "RTR"),
        ("sent-on-request", _tpdo(2, 0x333, kind=254), ""),
        ("emcy-of-other", holds(5, x1014=0x080), ""),
        ("emcy-of-other", holds(5, x1014=0x081), "EMCY of node 1"),
        ("emcy-of-other", holds(5, x1014=0x0FF), "EMCY of node 127"),
        ("emcy-of-other", holds(5, x1014=0x100), ""),
        ("emcy-of-other", holds(5, x1014=0x2000_0081), ""),
        ("emcy-can-id", holds(5, x1014=0x581), "0x581"),
        ("emcy-can-id", holds(5, x1014=0x2000_0581), ""),
        ("emcy-can-id", holds(5, x1014=0x8000_0581), ""),
        ("time-ids-differ", also(holds(10, x1012=0x4000_0100), holds(5, x1012=0x8000_0110)), "0x110"),
        ("time-ids-differ", also(holds(10, x1012=0x4000_0100), holds(5, x1012=0x8000_0100)), ""),
        ("time-ids-differ", also(holds(10, x1012=0x4000_0100), holds(5, x1012=0x0000_0110)), ""),
        ("time-ids-differ", also(holds(10, x1012=0x4000_0100), holds(5, x1012=0x4000_0110)), ""),
        ("two-times", also(holds(10, x1012=0x4000_0100), holds(5, x1012=0x4000_0100)), "node 5 sends it"),
        ("two-times", also(holds(10, x1012=0x4000_0100), holds(5, x1012=0x4000_0110)), ""),
        ("can-id-of-other", _tpdo(4, 0x281), "TPDO2 of node 1"),
        ("can-id-of-other", _tpdo(5, 0x281), ""),
        ("can-id-of-other", _tpdo(4, 0x281, extended=True), ""),
        ("other-formula", _OTHER_ID, "TPDO1 of node 37"),
        ("other-formula", _tpdo(5, 0x1A5), ""),  # nobody has the other node-ID
        ("other-formula", also(node(10, node_id=37), _tpdo(4, 0x1A5)), ""),
        ("other-formula", also(node(10, node_id=37), _tpdo(16, 0x1A5)), "TPDO1 of node 37"),
        ("other-formula", also(node(10, node_id=37), _tpdo(17, 0x1A5)), ""),
        ("other-formula", also(node(10, node_id=37), _tpdo(5, 0x1A5, extended=True)), ""),
        ("other-formula", also(node(10, node_id=69), _tpdo(5, 0x1C5)), "TPDO1 of node 69"),
        ("other-formula", also(node(10, node_id=101), _tpdo(5, 0x1E5)), "TPDO1 of node 101"),
        ("other-formula", also(node(10, node_id=38), _tpdo(5, 0x1A6)), ""),  # 33 more: another formula
        ("other-formula", also(node(5, node_id=32), _tpdo(5, 0x1C0, 32)), ""),
        ("other-formula", also(node(5, node_id=33), _tpdo(5, 0x1C1, 33)), "TPDO1 of node 65"),
        ("node-id-of-master", master(node_id=5), "5 is the node-ID"),
        ("node-id-of-master", master(node_id=127), ""),
        ("can-id-of-sdo", also(holds(1, x1280_01=0x3A1), _tpdo(2, 0x3A1)), "0x3A1"),
        ("can-id-of-sdo", also(holds(1, x1280_01=0x8000_03A1), _tpdo(2, 0x3A1)), ""),
        ("can-id-of-sdo", also(holds(1, x1280_01=0x605), _tpdo(2, 0x605)), "0x605"),
        ("can-id-of-sdo", also(holds(1, x1280_01=0x2000_0605), _tpdo(2, 0x605, extended=True)), "0x00000605"),
        ("sync-start-without-counter", _counts(0, 2), "start value is 2"),
        ("sync-start-without-counter", _counts(1, 2), "start value is 2"),  # 1 is reserved
        ("sync-start-without-counter", _counts(2, 2), ""),
        ("sync-start-without-counter", _counts(0, 0), ""),
        ("sync-start-without-counter", also(_counts(0, 2), holds(5, x1019=4)), "start value is 2"),
        ("sync-start-over-counter", _counts(4, 4), ""),
        ("sync-start-over-counter", _counts(4, 5), "start value is 5, the counter ends with 4"),
        ("sync-start-over-counter", _counts(2, 3), "start value is 3"),
        ("sync-start-over-counter", _counts(1, 3), ""),
        ("sync-start-over-counter", _counts(0, 3), ""),
        ("sync-counters-differ", also(holds(10, x1019=4), holds(5, x1019=4)), ""),
        ("sync-counters-differ", also(holds(10, x1019=4), holds(5, x1019=8)), "it counts to 8, node 10 to 4"),
        ("sync-counters-differ", also(holds(10, x1019=4), holds(5, x1019=0)), ""),
        ("sync-counters-differ", holds(5, x1019=8), "it counts to 8, node 10 to 0"),
    ],
)  # fmt: skip
def test_a_rule_of_services_begins_where_the_standard_says(rule: str, change: Change, said: str) -> None:
    texts = [text for _, _, text in network_findings(Planted(rule, change).network, {rule})]
    assert len(texts) == bool(said), texts
    assert said in "".join(texts)


def test_a_node_without_the_object_of_sync_is_named_with_its_own_pdo() -> None:
    planted = Planted("synchronous-without-sync", lacks(5, 0x1005))
    assert [spot for _, spot, _ in network_findings(planted.network, {planted.rule})] == [NetSpot(5, R1)]


@pytest.mark.parametrize(
    ("named", "rule", "spot"),
    [
        ({1: T1}, "sync-not-produced", NetSpot(1, T1)),
        ({5: R1}, "sync-not-produced", NetSpot(5, R1)),
        ({}, "sync-from-elsewhere", NetSpot(1, T1)),
        ({5: T1}, "sync-from-elsewhere", NetSpot(1, T1)),  # that TPDO is sent on events
    ],
)
def test_a_file_whose_master_sends_no_sync_is_wrong_if_it_names_a_synchronous_pdo(
    named: dict[int, Pdo], rule: str, spot: NetSpot
) -> None:
    asked = [node(node_id, marks={which: Mark(4)}) for node_id, which in named.items()]
    state = also(holds(10, x1005=0x80), master(node_id=127, sync_period_us=0), *asked)(SOUND)
    network = CheckedNetwork(state._replace(file="net.yaml"), BIT_RATE)
    both = {"sync-not-produced", "sync-from-elsewhere"}
    assert [(found.name, at) for found, at, _ in network_findings(network, both)] == [(rule, spot)]


@pytest.mark.parametrize(
    ("more", "said"), [(also(), "ms after SYNC; the window is 0.5 ms"),
                       (has(1, T2, pdo(0x182, _STATUS_ONLY)), "at any time; the window is 0.5 ms")],
)  # fmt: skip
def test_a_synchronous_pdo_behind_the_window_is_said_to_come_when_it_may(more: Change, said: str) -> None:
    """A TPDO without inhibit time and event timer may keep the bus from all that come after it."""
    planted = next(one for one in PLANTED if one.rule == "sync-window")
    network = CheckedNetwork(also(planted.change, more)(SOUND), BIT_RATE)
    texts = [text for _, _, text in network_findings(network, {"sync-window"})]
    assert texts
    assert all(said in text for text in texts), texts

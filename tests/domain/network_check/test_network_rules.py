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
from dvtcli.domain.pdo import PdoConfig
from dvtcli.domain.ports import Frame
from tests.domain.network_check.planted import (
    BIT_RATE,
    PLANTED,
    SOUND,
    T1,
    T2,
    Planted,
    also,
    concise,
    entry,
    has,
    hears,
    holds,
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

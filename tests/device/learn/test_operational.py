"""`learn --isolated` on a node that was found OPERATIONAL: what it takes there, and what it takes in no state."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.nmt import NmtState
from dvtcli.domain.profile import PreOperational
from dvtcli.files.eds.reader import read_eds
from dvtcli.files.profiles import load_folder_profile
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family, load_family_folder
from tests.device.learn.questions import Question, put
from tests.device.learn.test_learnt_families import booted
from tests.device.learn.test_put_back import values
from tests.device.learn.virtual import VirtualWire, own
from tests.harness.sample import heavy

EDS = family_eds("generic")
PDOS, MAPPINGS = (0x1400, 0x1BFF), (0x1600, 0x17FF)
QUESTIONS = [
    Question(f"0x{index:04X}:{sub:02X}", ((index, sub, value, size),), operational=True)
    for index, sub, value, size in (
        (0x1803, 1, 0xC0000481, 4), (0x1803, 2, 254, 1), (0x1A03, 0, 0, 1), (0x1A01, 0, 0, 1), (0x1803, 5, 7, 2),
        (0x1403, 1, 0xC0000501, 4), (0x1403, 2, 254, 1), (0x1603, 0, 0, 1), (0x1017, 0, 7, 2), (0x1010, 1, 0, 4),
    )
]  # fmt: skip


@pytest.mark.parametrize(
    ("behaviour", "gate"),
    [
        ({}, PreOperational.NO),
        ({"pre_operational_writes": (PDOS,)}, PreOperational.REQUIRED),
        ({"pre_operational_writes": (PDOS,), "wrong_state": 0x06010002}, PreOperational.REQUIRED),
        ({"pre_operational_writes": (MAPPINGS,)}, PreOperational.REQUIRED),
    ],
    ids=["none", "all", "another code", "mappings of RPDOs"],
)
def test_what_operational_refuses_is_learnt(behaviour: dict[str, object], gate: PreOperational) -> None:
    node = StrictDevice(read_eds(EDS).dictionary, load_family("generic")._replace(**behaviour), 1)
    wire = VirtualWire(node)
    with wire.bench({"eds": str(EDS)}) as bench:
        assert bench.run("nmt start").code == 0
        before = values(node)
        told = " ".join(bench.run("learn --isolated").stderr.split())
        assert "PDOs that are off are written in OPERATIONAL, too" in told
        ran = bench.run("learn --isolated --yes --save pump --json")
        assert ran.code == 0, ran
        bench.session.end_line(0)
        assert node.state is NmtState.OPERATIONAL
        assert values(node) == before
    assert load_folder_profile(Path("pump")).pre_operational_gate is gate
    learnt = load_family_folder(Path("pump"))
    for question in QUESTIONS:
        assert put(booted(EDS, node.family), question) == put(booted(EDS, learnt), question), question


@heavy
def test_without_isolated_operational_says_nothing() -> None:
    family = load_family("generic")._replace(pre_operational_writes=(PDOS,))
    node = StrictDevice(read_eds(EDS).dictionary, family, 1)
    wire = VirtualWire(node)
    with wire.bench({"eds": str(EDS)}) as bench:
        bench.run("nmt start")
        document = bench.run("learn --yes --json").document
    assert not [row for row in document["profile"] if row["key"] == "pre_operational_gate"]
    asked = [row for row in document["probes"] if "OPERATIONAL" in row["name"]]
    assert {row["why"] for row in asked} == {"only on a silent bus with the node OPERATIONAL"}


@heavy
def test_what_is_not_asked_of_an_enabled_pdo_in_operational_is_said_with_the_reason() -> None:
    with own("tmcm") as bench:
        assert bench.run("nmt start").code == 0
        ran = bench.run("learn --isolated --yes")
    assert ran.code == 0, ran
    told = " ".join(ran.stdout.split())
    for label in ("TPDO4", "RPDO4"):
        why = f"{label} is enabled: only a PDO that is off is asked in OPERATIONAL"
        assert f"not learnt: COB-ID, type, count, entry and 2 more in OPERATIONAL: {why}" in told


def test_a_family_s_other_ranges_stay() -> None:
    """Those of a family that it is like, which no PDO is in."""
    from dvtcli.domain.learning.probe import Learnt, merged

    learnt = Learnt("pre_operational_writes", [[0x1A00, 0x1BFF]], "")
    found = merged(learnt, [(0x1010, 0x1011), (0x13F0, 0x1BFF), (0x1400, 0x1C05), (0x3000, 0x3400)])
    assert found.value == [[0x1A00, 0x1BFF], [0x1010, 0x1011], [0x13F0, 0x13FF], [0x1C00, 0x1C05], [0x3000, 0x3400]]


@heavy
def test_rules_that_hold_in_operational_only_are_learnt() -> None:
    family = load_family("generic")._replace(pdo_rules_always=False)
    node = StrictDevice(read_eds(EDS).dictionary, family, 1)
    wire = VirtualWire(node)
    with wire.bench({"eds": str(EDS), "profile": "generic"}) as bench:
        assert bench.run("nmt start").code == 0
        before = values(node)
        ran = bench.run("learn --isolated --yes --save pump --json")
        assert ran.code == 0, ran
        bench.session.end_line(0)
        assert values(node) == before
    learnt = load_family_folder(Path("pump"))
    assert learnt.pdo_rules_always is False
    for state in (True, False):
        for sub, value in ((0, 9), (1, 0x5FFE0010), (1, 0x10180120), (1, 0)):
            question = Question("rule", ((0x1A03, sub, value, 4 if sub else 1),), operational=state)
            assert put(booted(EDS, family), question) == put(booted(EDS, learnt), question), question
        question = Question("type", ((0x1803, 2, 241, 1),), operational=state)
        assert put(booted(EDS, family), question) == put(booted(EDS, learnt), question), question


@pytest.mark.parametrize("step", [1, 3, 40])
def test_a_node_that_restarts_while_it_is_asked_in_operational_is_operational_again(step: int) -> None:
    node = StrictDevice(read_eds(EDS).dictionary, load_family("generic"), 1)
    wire = VirtualWire(node, faults=(f"reset@{step}=0.05",))
    with wire.bench({"eds": str(EDS)}) as bench:
        bench.run("nmt start")
        before = values(node)
        ran = bench.run("learn --isolated --yes --json")
        assert (ran.code in (1, 5), ran.document["state"]) == (True, "rolled_back"), ran
        bench.session.end_line(ran.code)
        assert node.state is NmtState.OPERATIONAL
        assert values(node) == before


def test_a_node_that_restarted_there_in_a_script_stays_pre_operational_and_that_is_told() -> None:
    node = StrictDevice(read_eds(EDS).dictionary, load_family("generic"), 1)
    wire = VirtualWire(node, faults=("reset@1=0.05",))
    with wire.bench({"eds": str(EDS)}) as bench:
        ran = bench.script("nmt start", "learn --isolated --yes")
        assert ran.code in (1, 5), ran
        assert node.state is NmtState.PRE_OPERATIONAL
        told = " ".join(ran.stderr.split())
        assert "was OPERATIONAL and is PRE-OPERATIONAL now; when it is right: nmt start 1" in told

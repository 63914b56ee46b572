"""Values that depend on each other: SYNC, heartbeat consumers, COB-IDs of services. A strict device takes any of them.

From each legal configuration to each other one, in an order that CiA 301 allows; and back after any fault.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.plan import Plan, Step, ValueChange, altering
from dvtcli.errors import DvtcliError, SdoAborted
from dvtcli.files.eds.reader import read_eds
from tests.cli.commands.bench import Bench
from tests.laws.bench import (
    NODE,
    DirectSdo,
    Fault,
    FaultySdo,
    booted,
    dictionary,
    ignore,
    lose_answer,
    lose_request,
    refuse,
    transaction,
)
from tests.small_eds import U8, U16, U32, plain, var

Place = tuple[int, int]
Values = dict[Place, bytes]

SLOTS = (1, 2, 3)
_SIZES = {0x1017: 2, 0x1019: 1}
laws = settings(
    max_examples=max(3, settings().max_examples // 3), deadline=None, suppress_health_check=list(HealthCheck)
)


def rich() -> str:
    """An EDS with everything whose values depend on each other."""
    eds = plain()
    eds.variable(0x1005, var("COB-ID SYNC", U32, 0x80))
    eds.variable(0x1006, var("Communication cycle period", U32, 0))
    eds.variable(0x1012, var("COB-ID TIME", U32, 0x100))
    eds.variable(0x1014, var("COB-ID EMCY", U32, "$NODEID+0x80"))
    eds.record(0x1016, "Consumer heartbeat time", {one: var(f"Consumer {one}", U32, 0) for one in SLOTS})
    eds.variable(0x1017, var("Producer heartbeat time", U16, 0))
    eds.variable(0x1019, var("Synchronous counter overflow value", U8, 0))
    for index, name in ((0x1201, "server"), (0x1280, "client")):
        keys = {sub: var(f"COB-ID {sub}", U32, 0x8000_0000) for sub in (1, 2)}
        eds.record(index, f"SDO {name}", {**keys, 3: var("Node-ID", U8, 0)})
    return eds.text()


@lru_cache
def described(family: str) -> ObjectDictionary:
    if family != "rich":
        return dictionary(family)
    with TemporaryDirectory() as folder:
        (Path(folder) / "rich.eds").write_text(rich(), encoding="utf-8")
        return read_eds(Path(folder) / "rich.eds").dictionary


def device(family: str) -> DirectSdo:
    return DirectSdo(booted("generic" if family == "rich" else family, described(family)))


def places(family: str) -> list[Place]:
    """Objects of the family that depend on others, and the heartbeat time, which does not."""
    indices = (0x1005, 0x1006, 0x1012, 0x1014, 0x1016, 0x1017, 0x1019, 0x1201, 0x1280)
    return [
        (entry.index, entry.sub_index) for entry in described(family).entries()
        if entry.index in indices and entry.access.writable
    ]  # fmt: skip


@st.composite
def configurations(draw: st.DrawFn, family: str) -> Values:
    """A legal configuration of all these objects: no node is waited for twice."""
    there = places(family)
    slots = [place for place in there if place[0] == 0x1016]
    nodes = draw(st.permutations([0, 11, 12, 13]))
    found: dict[Place, int] = {}
    for place, node_id in zip(slots, nodes, strict=False):
        found[place] = node_id << 16 | draw(st.sampled_from([100, 200])) if node_id else 0
    off, used = st.sampled_from([0, 1 << 31]), st.sampled_from
    drawn = {
        0x1005: used([0x80, 0x81, 0x4000_0080, 0x4000_0081]),
        0x1006: used([0, 10_000, 20_000]),
        0x1012: used([0x100, 0x101, 0x4000_0100, 0x8000_0101, 0xC000_0100]),
        0x1014: st.builds(int.__or__, off, used([0x81, 0x82])),
        0x1017: used([0, 500]),
        0x1019: used([0, 10, 20]),
    }
    for place in there:
        if place[0] in drawn:
            found[place] = draw(drawn[place[0]])
        elif place[0] in (0x1201, 0x1280):
            ids = st.builds(int.__or__, off, used([0x6A0, 0x6A1]))
            found[place] = draw(used([1, 2]) if place[1] == 3 else ids)
    return {place: value.to_bytes(_size(place), "little") for place, value in found.items()}


def _size(place: Place) -> int:
    return 1 if place[0] in (0x1201, 0x1280) and place[1] == 3 else _SIZES.get(place[0], 4)


def plan_to(sdo: DirectSdo, wanted: Values) -> Plan:
    steps = [Step(*place, sdo.upload(*place), data, "write") for place, data in wanted.items()]
    return Plan(NODE, tuple(map(ValueChange, altering(steps))))


def held(sdo: DirectSdo, wanted: Values) -> Values:
    return {place: sdo.upload(*place) for place in wanted}


families = pytest.mark.parametrize("family", ["rich", "generic", "gen4", "canopennode", "lely"])


@families
@laws
@given(data=st.data())
def test_from_any_configuration_to_any_other_and_back(family: str, data: st.DataObject) -> None:
    sdo = device(family)
    for wanted in data.draw(st.lists(configurations(family), min_size=2, max_size=3)):
        before = held(sdo, wanted)
        plan = plan_to(sdo, wanted)
        sdo.writes.clear()
        transaction(sdo, plan).run()
        assert held(sdo, wanted) == wanted
        assert [(step.index, step.sub_index, step.after) for step in plan.steps] == sdo.writes
        assert len(plan) == len(sdo.writes)
        transaction(sdo, plan.reversed()).run()
        assert held(sdo, wanted) == before
        transaction(sdo, plan).run()


@families
@laws
@given(data=st.data())
def test_a_fault_at_any_step_brings_the_old_one_back(family: str, data: st.DataObject) -> None:
    sdo = device(family)
    start, wanted = data.draw(configurations(family)), data.draw(configurations(family))
    transaction(sdo, plan_to(sdo, start)).run()
    plan = plan_to(sdo, wanted)
    fault: Fault = data.draw(st.sampled_from([refuse, lose_request, lose_answer, ignore]))
    at = data.draw(st.integers(1, max(1, len(plan))))
    state = ""
    try:
        transaction(FaultySdo(sdo, fault, at), plan).run()
    except DvtcliError as failed:
        state = failed.state or "?"
    # without a fault: nothing was written, or what the device ignored was a release that it does not ask for
    assert (state, held(sdo, wanted)) == (("rolled_back", start) if state else ("", wanted))


def test_the_strict_device_refuses_each_of_these_where_it_is_written_at_once() -> None:
    sdo = device("rich")
    for index, sub_index, first, then in (
        (0x1005, 0, 0x4000_0080, 0x4000_0081),
        (0x1012, 0, 0x8000_0100, 0x8000_0101),
        (0x1014, 0, 0x81, 0x82),
        (0x1201, 1, 0x6A0, 0x6A1),
        (0x1280, 2, 0x6A0, 0x6A1),
    ):
        sdo.download(index, sub_index, first.to_bytes(4, "little"))
        with pytest.raises(SdoAborted) as refused:
            sdo.download(index, sub_index, then.to_bytes(4, "little"))
        assert refused.value.code == 0x0609_0030, hex(index)


def test_the_fewest_writes() -> None:
    def order(*steps: tuple[int, int, int, int]) -> list[tuple[int, int, int]]:
        made = [Step(i, s, b.to_bytes(4, "little"), a.to_bytes(4, "little"), "write") for i, s, b, a in steps]
        found = Plan(NODE, tuple(map(ValueChange, made)))
        return [(step.index, step.sub_index, int.from_bytes(step.after, "little")) for step in found.steps]

    one, two, three = 0x000B_0064, 0x000C_0064, 0x000D_0064
    assert order((0x1016, 1, one, two), (0x1016, 2, two, three)) == [(0x1016, 2, three), (0x1016, 1, two)]
    assert order((0x1016, 1, one, two), (0x1016, 2, two, one)) == [
        (0x1016, 1, 0), (0x1016, 2, one), (0x1016, 1, two)
    ]  # fmt: skip
    assert order((0x1005, 0, 0x80, 0x4000_0080), (0x1006, 0, 0, 1000)) == [(0x1006, 0, 1000), (0x1005, 0, 0x4000_0080)]
    assert order((0x1006, 0, 1000, 0), (0x1005, 0, 0x4000_0080, 0x80)) == [(0x1005, 0, 0x80), (0x1006, 0, 0)]
    assert order((0x1006, 0, 1000, 1000), (0x1019, 0, 0, 10)) == [(0x1006, 0, 0), (0x1019, 0, 10), (0x1006, 0, 1000)]
    assert order((0x1014, 0, 0x81, 0x8000_0081)) == [(0x1014, 0, 0x8000_0081)]
    assert order((0x1014, 0, 0x81, 0x82)) == [(0x1014, 0, 0x8000_0081), (0x1014, 0, 0x82)]


@settings(max_examples=max(2, settings().max_examples // 20), deadline=None, suppress_health_check=list(HealthCheck))
@given(start=configurations("rich"), wanted=configurations("rich"), at=st.integers(1, 12))
def test_apply_of_a_file_does_so_too(start: Values, wanted: Values, at: int) -> None:
    writes = len(plan_to(device("rich"), start))
    with TemporaryDirectory() as folder:
        (Path(folder) / "rich.eds").write_text(rich(), encoding="utf-8")
        what, file = f"{folder}/rich.eds@1", Path(folder) / "node.dcf"
        with Bench((what,)) as bench:
            _bring(bench, wanted)
            assert bench.run(f"export {file}").code == 0
        with Bench((what,), {"fault": (f"refuse@{writes + at}=0x08000000",)}) as bench:
            _bring(bench, start)
            ran = bench.run(f"apply {file} --force --yes")
            assert (ran.code, "rolled back" in ran.stderr) in ((0, False), (1, True)), ran.stderr
            assert _held(bench, wanted) == (start if ran.code else wanted)
            again = bench.run(f"apply {file} --force --yes")
            assert again.code == 0, again.stderr
            assert _held(bench, wanted) == wanted
            assert bench.run(f"verify {file}").code == 0
            if start != wanted:
                undone = bench.run("undo --yes")
                if undone.code and not ran.code:  # the fault came that late
                    assert "rolled back" in undone.stderr
                    assert _held(bench, wanted) == wanted
                    undone = bench.run("undo --yes")
                assert undone.code == 0, undone.stderr
                assert _held(bench, wanted) == start


def _bring(bench: Bench, values: Values) -> None:
    sdo = bench.session.node().sdo
    steps = [Step(*place, sdo.upload(*place), data, "write") for place, data in values.items()]
    for step in Plan(1, tuple(map(ValueChange, altering(steps)))).steps:
        sdo.download(step.index, step.sub_index, step.after)


def _held(bench: Bench, values: Values) -> Values:
    sdo = bench.session.node().sdo
    return {place: sdo.upload(*place) for place in values}

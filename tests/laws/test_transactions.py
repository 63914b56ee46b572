"""After any plan a strict device is as planned or as it was, whatever goes wrong on the way."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from dvtcli.device.cancellation import Cancellation
from dvtcli.device.read_pdos import present_pdos, read_pdo
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Direction, Pdo, PdoConfig, PdoMappingEntry
from dvtcli.domain.plan import Plan, Step, plan_pdo
from dvtcli.domain.rules import check_pdo, errors_in
from dvtcli.errors import DeviceRefused, DvtcliError, Interrupted, LeftChanged, NoAnswer
from tests.laws.bench import (
    FAMILIES,
    NODE,
    DirectSdo,
    Fault,
    FaultySdo,
    booted,
    correct,
    crash,
    dictionary,
    ignore,
    interrupt_after,
    interrupt_before,
    lose_answer,
    lose_request,
    profile,
    proposal,
    refuse,
    silence,
    transaction,
)
from tests.laws.configurations import legal

Configs = dict[Pdo, PdoConfig]
laws = settings(
    max_examples=max(3, settings().max_examples // 5), deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
families = pytest.mark.parametrize("family", FAMILIES)
TPDO1 = Pdo(Direction.TPDO, 1)


@dataclass
class Bench:
    """A device that holds *start*, and a plan that takes it to *goal*."""

    sdo: DirectSdo
    start: Configs
    goal: Configs
    plan: Plan = field(init=False)

    def __post_init__(self) -> None:
        changes = tuple(plan_pdo(pdo, self.start[pdo], want) for pdo, want in self.goal.items())
        self.plan = Plan(NODE, changes)

    def held(self) -> Configs:
        return {pdo: read_pdo(self.sdo, pdo) for pdo in self.start}

    def run(self, fault: Fault, at: int, *, forever: bool = False) -> None:
        transaction(FaultySdo(self.sdo, fault, at, forever), self.plan).run()


@st.composite
def benches(draw: st.DrawFn, family: str) -> Bench:
    """A device in a random legal state, and one to three PDOs that shall change."""
    sdo = DirectSdo(booted(family))
    every = present_pdos(sdo, dictionary(family))
    pdos = draw(st.lists(st.sampled_from(every), min_size=1, max_size=3, unique=True))
    start = {}
    for pdo in pdos:
        factory = read_pdo(sdo, pdo)
        first = draw(legal(family, pdo, factory))
        assume(not errors_in(check_pdo(proposal(pdo, factory, first, dictionary(family), profile(family)))))
        transaction(sdo, Plan(NODE, (plan_pdo(pdo, factory, first),))).run()
        start[pdo] = first
    goal = {pdo: draw(legal(family, pdo, start[pdo])) for pdo in pdos}
    for pdo in pdos:
        assume(not errors_in(check_pdo(proposal(pdo, start[pdo], goal[pdo], dictionary(family), profile(family)))))
    sdo.writes.clear()
    return Bench(sdo, start, goal)


@families
@laws
@given(data=st.data())
def test_an_applied_plan_reads_back_as_planned(family: str, data: st.DataObject) -> None:
    bench = data.draw(benches(family))
    assert bench.held() == bench.start
    taken: list[Step] = []
    transaction(bench.sdo, bench.plan, on_step=taken.append).run()
    assert bench.held() == bench.goal
    assert taken == list(bench.plan.steps)
    assert len(bench.sdo.writes) == len(bench.plan)


@families
@laws
@given(data=st.data())
def test_every_step_says_what_the_object_holds_at_that_moment(family: str, data: st.DataObject) -> None:
    bench = data.draw(benches(family))
    for step in bench.plan.steps:
        assert step.before in (None, bench.sdo.upload(step.index, step.sub_index))
        bench.sdo.download(step.index, step.sub_index, step.after)


@families
@laws
@given(data=st.data())
def test_the_reversed_plan_puts_everything_back(family: str, data: st.DataObject) -> None:
    bench = data.draw(benches(family))
    transaction(bench.sdo, bench.plan).run()
    transaction(bench.sdo, bench.plan.reversed()).run()
    assert bench.held() == bench.start


@families
@laws
@given(data=st.data())
def test_what_is_as_wanted_takes_no_write(family: str, data: st.DataObject) -> None:
    bench = data.draw(benches(family))
    for pdo, config in bench.start.items():
        assert plan_pdo(pdo, config, config).steps == ()


FAULTS: list[tuple[Fault, type[BaseException]]] = [
    (refuse, DeviceRefused),
    (lose_request, NoAnswer),
    (lose_answer, NoAnswer),
    (interrupt_before, Interrupted),
    (interrupt_after, Interrupted),
    (crash, RuntimeError),
]


@pytest.mark.drawn(6)
@families
@pytest.mark.parametrize(("fault", "error"), FAULTS, ids=[fault.__name__ for fault, _ in FAULTS])
@laws
@given(data=st.data())
def test_a_fault_at_any_step_leaves_the_device_as_it_was(
    family: str, fault: Fault, error: type[BaseException], data: st.DataObject
) -> None:
    bench = data.draw(benches(family))
    assume(len(bench.plan))
    at = data.draw(st.integers(1, len(bench.plan)))
    with pytest.raises(error) as caught:
        bench.run(fault, at)
    assert bench.held() == bench.start
    if isinstance(caught.value, DvtcliError):
        assert caught.value.state == "rolled_back"
        assert caught.value.node == NODE


@families
@laws
@given(data=st.data())
def test_a_device_that_ignores_a_write_is_put_back_and_named(family: str, data: st.DataObject) -> None:
    bench = data.draw(benches(family))
    assume(len(bench.plan))
    at = data.draw(st.integers(1, len(bench.plan)))
    with suppress(DeviceRefused):  # a lost "count 0" may be overtaken by the abort of the next write
        bench.run(ignore, at)
        assert bench.held() == bench.goal
        return
    assert bench.held() == bench.start


@families
@laws
@given(data=st.data())
def test_a_request_to_stop_is_obeyed_between_two_steps_and_undone(family: str, data: st.DataObject) -> None:
    bench = data.draw(benches(family))
    assume(len(bench.plan) > 1)
    at = data.draw(st.integers(1, len(bench.plan) - 1))
    cancellation = Cancellation()
    cancellation.exit_code = 143
    taken: list[Step] = []

    def stop(step: Step) -> None:
        taken.append(step)
        assert cancellation.active
        cancellation.requested = len(taken) == at

    with pytest.raises(Interrupted) as caught:
        transaction(bench.sdo, bench.plan, cancellation=cancellation, on_step=stop).run()
    assert len(taken) == at
    assert (caught.value.exit_code, caught.value.state) == (143, "rolled_back")
    assert bench.held() == bench.start
    assert not cancellation.active


@pytest.mark.drawn(6)
@families
@pytest.mark.parametrize("fault", [refuse, lose_request, interrupt_before])
@laws
@given(data=st.data())
def test_a_roll_back_that_fails_too_is_said(family: str, fault: Fault, data: st.DataObject) -> None:
    bench = data.draw(benches(family))
    assume(len(bench.plan) > 1)
    at = data.draw(st.integers(2, len(bench.plan)))
    with pytest.raises((LeftChanged, DvtcliError, KeyboardInterrupt)) as caught:
        bench.run(fault, at, forever=True)
    if bench.held() == bench.start:
        return  # nothing had to be written to put it back
    assert isinstance(caught.value, LeftChanged)
    assert caught.value.state == "left_changed"
    assert caught.value.exit_code == 7
    assert bench.plan.changes[0].label in str(caught.value)


def one_change(make: Callable[[PdoConfig], PdoConfig], pdo: Pdo = TPDO1) -> Bench:
    """A generic device and one change of its *pdo*."""
    sdo = DirectSdo(booted("generic"))
    now = read_pdo(sdo, pdo)
    return Bench(sdo, {pdo: now}, {pdo: make(now)})


def with_parameter(**values: object) -> Callable[[PdoConfig], PdoConfig]:
    return lambda now: now.with_parameters(**values)  # type: ignore[arg-type]


CHANGES: dict[str, Callable[[PdoConfig], PdoConfig]] = {
    "COB-ID of a live PDO": with_parameter(cob_id=CobId.from_raw(0x4000_0190)),
    "COB-ID and off": with_parameter(cob_id=CobId.from_raw(0xC000_0190)),
    "type": with_parameter(transmission_type=10),
    "inhibit time": with_parameter(inhibit_time=100),
    "event timer": with_parameter(event_timer=100),
    "mapping": lambda now: replace(now, mapping=(PdoMappingEntry(0x606C, 0, 32),)),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_value_that_the_device_corrects_in_silence_is_found_and_undone(name: str) -> None:
    """Whichever write the device bends, and it may bend several into one difference."""
    for at in range(1, len(one_change(CHANGES[name]).plan) + 1):
        bench = one_change(CHANGES[name])
        with suppress(DeviceRefused):
            bench.run(correct, at)
            assert bench.held() == bench.goal, "a bent value was taken for the wanted one"
            continue
        assert bench.held() == bench.start


def test_one_pdo_that_cannot_be_put_back_does_not_keep_the_others_changed() -> None:
    sdo = DirectSdo(booted("generic"))
    pdos = [TPDO1, Pdo(Direction.TPDO, 2)]
    start = {pdo: read_pdo(sdo, pdo) for pdo in pdos}
    bench = Bench(sdo, start, {pdo: CHANGES["COB-ID and off"](start[pdo]) for pdo in pdos})
    with pytest.raises(LeftChanged) as caught:
        transaction(NeverAgain(sdo, 0x1801), bench.plan).run()
    held = bench.held()
    assert held[TPDO1] == start[TPDO1]
    assert held[pdos[1]] != start[pdos[1]]
    assert caught.value.state == "left_changed"


class NeverAgain(DirectSdo):
    """Takes one write to *index* and loses its answer, and refuses every later one."""

    def __init__(self, inner: DirectSdo, index: int) -> None:
        super().__init__(inner.device)
        self.index = index

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        before = sum(written == self.index for written, _, _ in self.writes)
        if index == self.index and before:
            refuse(self, index, sub_index, data)
        super().download(index, sub_index, data, timeout_s=timeout_s)
        if index == self.index and before == 0:
            raise silence(index, sub_index)

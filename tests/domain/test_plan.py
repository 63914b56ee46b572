from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.plan import Plan, Step, ValueChange, alters, only_cob_id, plan_pdo, writes_cob_id
from tests.domain.configs import ModelDevice, config_pairs, configs, mappings, memory_of, pdos

Pair = tuple[PdoConfig, PdoConfig]


def is_mapping(step: Step) -> bool:
    return 0x1600 <= step.index <= 0x17FF or 0x1A00 <= step.index <= 0x1BFF


@given(pdos, configs)
def test_nothing_to_change_is_no_step(pdo: Pdo, a: PdoConfig) -> None:
    assert plan_pdo(pdo, a, a).steps == ()


@given(pdos, config_pairs())
def test_a_device_gets_from_a_to_b_and_back(pdo: Pdo, pair: Pair) -> None:
    """The device's own rules hold the order laws: frozen mapping, count 0 first, frozen COB-ID, inhibit time."""
    a, b = pair
    change = plan_pdo(pdo, a, b)
    device = ModelDevice(pdo, a)
    device.run(change.steps)
    assert device.holds(b)
    device.run(change.reversed().steps)
    assert device.holds(a)


@given(pdos, config_pairs())
def test_a_step_knows_what_it_replaces_wherever_that_was_read(pdo: Pdo, pair: Pair) -> None:
    held = memory_of(pdo, pair[0])
    unknown = [step for step in plan_pdo(pdo, *pair).steps if step.before is None]
    assert not held.keys() & {(step.index, step.sub_index) for step in unknown}


@pytest.mark.parametrize("pdo", [Pdo.parse("tpdo1"), Pdo.parse("tpdo512"), Pdo.parse("rpdo2")])
def test_only_a_pdo_s_cob_id_is_one(pdo: Pdo) -> None:
    communication, mapping = pdo.communication_index, pdo.mapping_index
    for index, sub_index, said in (
        (communication, 1, True), (communication, 2, False), (mapping, 1, False), (0x1014, 0, False),
    ):  # fmt: skip
        assert writes_cob_id(Plan(5, (ValueChange(Step(index, sub_index, None, bytes(4), "write")),))) is said
    other = ValueChange(Step(0x1017, 0, None, bytes(2), "write"))
    moved = ValueChange(Step(communication, 1, None, bytes(4), "write"))
    assert writes_cob_id(Plan(5, (other, moved)))


def test_a_pdo_that_is_only_switched_gets_its_cob_id_only() -> None:
    pdo = Pdo.parse("tpdo1")
    enabled = PdoConfig(PdoCommunicationParameter(CobId(0x181), 255), ())
    disabled = enabled.disabled()
    other = replace(disabled, communication=replace(disabled.communication, transmission_type=1))
    assert only_cob_id(plan_pdo(pdo, enabled, disabled))
    assert not only_cob_id(plan_pdo(pdo, disabled, other))
    assert not only_cob_id(plan_pdo(pdo, enabled, other))
    assert not only_cob_id(plan_pdo(pdo, enabled, enabled))
    assert not only_cob_id(ValueChange(Step(pdo.communication_index, 1, None, bytes(4), "write")))


@given(pdos, config_pairs())
def test_the_count_comes_last_before_the_enabling_write(pdo: Pdo, pair: Pair) -> None:
    a, b = pair
    assume(a.mapping != b.mapping)
    steps = [step for step in plan_pdo(pdo, a, b).steps if is_mapping(step)]
    subs = [step.sub_index for step in steps]
    assert subs == [0] * bool(a.mapping) + list(range(1, len(b.mapping) + 1)) + [0] * bool(b.mapping)
    every = plan_pdo(pdo, a, b).steps
    assert [is_mapping(step) for step in every[every.index(steps[0]) :]][: len(steps)] == [True] * len(steps)
    if b.enabled:
        last = every[-1]
        assert (last.index, last.sub_index, last.after) == (
            pdo.communication_index,
            1,
            b.communication.cob_id.raw.to_bytes(4, "little"),
        )


@given(pdos, config_pairs())
def test_disabling_is_needed_or_left_out_and_keeps_every_other_bit(pdo: Pdo, pair: Pair) -> None:
    a, b = pair
    steps = plan_pdo(pdo, a, b).steps
    cob_id_steps = [step for step in steps if (step.index, step.sub_index) == (pdo.communication_index, 1)]
    if not a.enabled:
        was, to_be = a.communication, b.communication
        asks = to_be.transmission_type in (252, 253) and was.transmission_type != to_be.transmission_type
        allows = to_be.cob_id.rtr_allowed and not was.cob_id.rtr_allowed
        first_and_last = asks and allows and b.enabled  # RTR is allowed before a type that answers it is set
        assert len(cob_id_steps) == (was.cob_id != to_be.cob_id) + first_and_last
        return
    live = replace(a.communication, transmission_type=0, event_timer=0)
    frozen = live != replace(b.communication, transmission_type=0, event_timer=0) or a.mapping != b.mapping
    assert bool(cob_id_steps) == frozen
    if frozen:
        first = steps[0]
        assert first is cob_id_steps[0]
        held = a.communication.cob_id.raw
        assert int.from_bytes(first.after, "little") == held | 0x8000_0000


@given(pdos, configs, st.integers(0, 0xFFFF))
def test_another_event_timer_is_one_step(pdo: Pdo, a: PdoConfig, timer: int) -> None:
    assume(a.communication.event_timer not in (None, timer))
    b = a.with_parameters(event_timer=timer)
    (step,) = plan_pdo(pdo, a, b).steps
    assert (step.object, step.after) == (f"{pdo.communication_index:04X}:05", timer.to_bytes(2, "little"))


@given(pdos, configs, st.integers(0, 0xFF))
def test_another_transmission_type_is_one_step(pdo: Pdo, a: PdoConfig, transmission_type: int) -> None:
    assume(a.communication.transmission_type not in (None, transmission_type))
    b = a.with_parameters(transmission_type=transmission_type)
    (step,) = plan_pdo(pdo, a, b).steps
    assert (step.object, step.after) == (f"{pdo.communication_index:04X}:02", bytes([transmission_type]))


@given(pdos, configs)
def test_switching_on_and_off_is_one_step(pdo: Pdo, a: PdoConfig) -> None:
    cob_id = a.communication.cob_id
    flipped = cob_id.disabled() if cob_id.valid else cob_id.enabled()
    b = a.with_parameters(cob_id=flipped)
    (step,) = plan_pdo(pdo, a, b).steps
    assert int.from_bytes(step.after, "little") == cob_id.raw ^ 0x8000_0000


@given(pdos, configs, mappings, st.booleans())
def test_a_plan_that_is_cut_leaves_the_pdo_disabled_or_as_it_was(
    pdo: Pdo, a: PdoConfig, mapping: tuple[PdoMappingEntry, ...], enabled: bool
) -> None:
    cob_id = a.communication.cob_id
    a = a.with_parameters(cob_id=replace(cob_id, valid=enabled))
    steps = plan_pdo(pdo, a, replace(a, mapping=mapping)).steps
    for cut in range(1, len(steps)):
        device = ModelDevice(pdo, a)
        device.run(steps[:cut])
        assert not device.valid


@given(st.lists(st.tuples(pdos, config_pairs()), max_size=3, unique_by=lambda item: item[0]))
def test_a_whole_plan_is_undone_in_the_opposite_order(items: list[tuple[Pdo, Pair]]) -> None:
    plan = Plan(5, tuple(plan_pdo(pdo, a, b) for pdo, (a, b) in items))
    back = plan.reversed()
    assert back.node_id == 5
    assert len(plan) == len(list(plan.steps))
    assert [change.label for change in back.changes] == [change.label for change in plan.changes][::-1]
    for pdo, (a, _) in items:
        device = ModelDevice(pdo, a)
        for whole in (plan, back):
            device.run(s for s in whole.steps if s.index in (pdo.communication_index, pdo.mapping_index))
        assert device.holds(a)


def test_one_value_is_undone_only_where_the_old_one_is_known() -> None:
    change = ValueChange(Step(0x1006, 0, bytes(4), bytes.fromhex("204E0000"), "SYNC every 20 ms"))
    assert (change.reversed().step.before, change.reversed().step.after) == (bytes.fromhex("204E0000"), bytes(4))
    assert change.steps == (change.step,)
    assert (change.label, change.reversed().reversed().step.after) == ("1006:00", change.step.after)
    with pytest.raises(ValueError, match="0x1006:00"):
        ValueChange(replace(change.step, before=None)).reversed()


@given(pdos, config_pairs())
def test_a_device_that_wants_a_pdo_off_first_gets_it_off_for_any_change_and_for_none_else(pdo: Pdo, pair: Pair) -> None:
    a, b = pair
    steps = plan_pdo(pdo, a, b, disabled_first=True).steps
    assert plan_pdo(pdo, a, a, disabled_first=True).steps == ()
    if a.enabled and a != b:
        assert steps[0].object == f"{pdo.communication_index:04X}:01"
        assert steps[0].after[3] & 0x80
    else:
        assert steps == plan_pdo(pdo, a, b).steps


@given(pdos, config_pairs())
def test_only_what_becomes_other_is_altered(pdo: Pdo, pair: Pair) -> None:
    a, b = pair
    assert alters(plan_pdo(pdo, a, b)) is (a != b)
    step = Step(0x1006, 0, bytes(4), bytes.fromhex("204E0000"), "SYNC every 20 ms")
    assert alters(ValueChange(step)) is True
    assert alters(ValueChange(replace(step, before=None))) is True
    assert alters(ValueChange(replace(step, before=step.after))) is False

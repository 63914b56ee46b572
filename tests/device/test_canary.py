"""Which value a proof changes, and to what: harmless, of a PDO that is off, and one that the rules allow."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.node import Node
from dvtcli.device.store.canary import Canary, CanaryParameter, choose_canary, harmless_places
from dvtcli.device.store.pending import CHANGE
from dvtcli.device.store.unstored import prepare_store
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.profile import GENERIC, DeviceProfile, StorePolicy
from dvtcli.errors import DvtcliError, LeftChanged, NoAnswer, SafetyRefusal
from tests.device.test_apply_plan import Bench as KeptBench
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary, refuse

TPDO1, TPDO2, RPDO1 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2"), Pdo.parse("rpdo1")


def node(profile: DeviceProfile = GENERIC) -> Node:
    return Node(DirectBus.of(booted()), NODE, dictionary("generic"), profile)


def off(one: Node, pdo: Pdo = TPDO1, *, held: dict[str, int | None] | None = None) -> PdoConfig:
    """*pdo* of *one* as it would be if it were disabled and its parameters were *held*."""
    config = one.pdo(pdo)
    cob_id = config.communication.cob_id.disabled()
    return config.with_parameters(cob_id=cob_id, **(held or {}))


def changes(one: Node, *configs: PdoConfig, pdo: Pdo = TPDO1) -> list[tuple[str, int, int | None, int | None]]:
    """What may be changed: which parameter, its sub-index, from which value and to which."""
    pdos = dict(zip((pdo, TPDO2), configs, strict=False))
    return [
        (place.field, place.sub_index, getattr(place.before.communication, place.field),
         getattr(place.after.communication, place.field))
        for place in harmless_places(one, pdos)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("held", "put"),
    [
        ({"event_timer": 0, "inhibit_time": 0, "transmission_type": 254}, [1000, 100, 255]),
        ({"event_timer": 7, "inhibit_time": 9, "transmission_type": 255}, [8, 10, 254]),
        ({"event_timer": 0xFFFF, "inhibit_time": 0xFFFF, "transmission_type": 1}, [0xFFFE, 0xFFFE, 255]),
    ],
)
def test_a_slow_value_where_there_is_none_else_the_neighbour(held: dict[str, int | None], put: list[int]) -> None:
    one = node()
    fields = [("event_timer", 5), ("inhibit_time", 3), ("transmission_type", 2)]
    wanted = [(*where, held[where[0]], value) for where, value in zip(fields, put, strict=True)]
    assert changes(one, off(one, held=held)) == wanted


def test_what_a_device_has_not_is_left_out() -> None:
    one = node()
    config = off(one, held={"event_timer": None, "inhibit_time": None, "transmission_type": 255})
    assert [field for field, *_ in changes(one, config)] == ["transmission_type"]


def test_the_same_parameter_of_another_pdo_comes_before_another_parameter() -> None:
    one = node()
    found = list(harmless_places(one, {TPDO1: off(one), TPDO2: off(one, TPDO2)}))
    assert [(place.field, place.pdo) for place in found[:3]] == [
        ("event_timer", TPDO1), ("event_timer", TPDO2), ("inhibit_time", TPDO1),
    ]  # fmt: skip


def test_a_pdo_that_is_on_or_multiplexed_is_never_touched() -> None:
    one = node()
    one_on = replace(off(one), communication=one.pdo(TPDO1).communication)
    assert one_on.enabled
    assert changes(one, one_on) == []
    assert changes(one, replace(off(one), mapping=(), mpdo=0xFE)) == []


def test_what_a_device_keeps_by_itself_shows_nothing() -> None:
    one = node(replace(GENERIC, store=StorePolicy(covers=(0x1400, 0x17FF))))
    assert changes(one, off(one)) == []
    assert changes(one, off(one, RPDO1), pdo=RPDO1) != []


def place(one: Node) -> CanaryParameter:
    one.bus.sdo(NODE).download(0x1800, 1, (0x8000_0181).to_bytes(4, "little"))
    found = next(harmless_places(one, one.pdos()))
    assert (found.pdo, found.field) == (TPDO1, "event_timer")
    return found


def test_it_is_told_with_its_place_and_both_values() -> None:
    found = place(node())
    before = found.before.communication.event_timer
    assert found.text == f"0x1800:05 (event timer of TPDO1) {before} -> {found.after.communication.event_timer}"
    assert found.rolled_back_text == f"0x1800:05 (event timer of TPDO1) is rolled back to {before}, read back equal"


def test_it_survived_where_its_value_is_there_whatever_else_changed() -> None:
    one = node()
    found = place(one)
    canary = Canary(one, found)
    assert not canary.is_still_there({TPDO1: found.before})
    assert canary.is_still_there({TPDO1: replace(found.after, mapping=())})
    assert not canary.is_still_there({})


class Choosy(DirectSdo):
    """A device that takes no event timer of the PDOs in *spared*."""

    spared: tuple[int, ...] = ()

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        if sub_index == 5 and index in self.spared:
            refuse(self, index, sub_index, data)
        super().download(index, sub_index, data)


@pytest.mark.parametrize(
    ("refused", "planted"), [(0, "event timer of TPDO1"), (1, "event timer of TPDO2"), (2, "event timer of TPDO3"),
                             (3, "heartbeat time in ms")],
)  # fmt: skip
def test_three_places_of_a_kind_are_tried_and_put_back(refused: int, planted: str) -> None:
    device = booted()
    channel = Choosy(device)
    channel.spared = tuple(range(0x1800, 0x1800 + refused))
    one = Node(DirectBus(device, channel), NODE, dictionary("generic"), GENERIC)
    for number in range(4):
        cob_id = 0x8000_0181 + number * 0x100
        channel.download(0x1800 + number, 1, cob_id.to_bytes(4, "little"))
    before = one.pdos()
    found = choose_canary(one, before)
    assert found is not None
    assert found.name == planted
    assert one.pdos() == before
    canary = Canary(one, found)
    assert canary.write()
    assert canary.is_still_there(one.pdos())
    canary.roll_back()
    assert one.pdos() == before


@pytest.fixture
def kept(tmp_path: Path) -> Iterator[KeptBench]:
    """A node with journals, whose TPDO1 is off."""
    made = KeptBench(tmp_path)
    made.device.download(0x1800, 1, (0x8000_0181).to_bytes(4, "little"))
    yield made
    made.guard.lock.release()


def written(kept: KeptBench) -> tuple[Canary, dict[Pdo, PdoConfig]]:
    before = kept.node.pdos()
    canary = Canary(kept.node, next(harmless_places(kept.node, before)))
    assert canary.write()
    assert canary.place.name == "event timer of TPDO1"
    return canary, before


def test_its_journal_stays_until_it_is_gone(kept: KeptBench) -> None:
    canary, _ = written(kept)
    assert kept.journal.exists()
    canary.close_journal()
    assert not kept.journal.exists()


def test_it_is_put_back_and_what_was_read_before_counts_no_longer(kept: KeptBench) -> None:
    canary, before = written(kept)
    kept.node.pdos()
    canary.roll_back()
    assert kept.node.last_read == {}
    assert (kept.node.pdos(), kept.journal.exists()) == (before, False)


def silent_for_good(kept: KeptBench) -> None:
    kept.bus.slept_s = 0
    kept.fault("silent", 0)


def test_what_cannot_be_put_back_is_left_to_recover_and_nothing_may_be_stored(kept: KeptBench) -> None:
    canary, _ = written(kept)
    silent_for_good(kept)
    with pytest.raises(LeftChanged) as caught:
        canary.roll_back()
    assert caught.value.text == f"node {NODE} was changed to prove the store, and that could not be rolled back"
    assert (caught.value.why or "").startswith(canary.place.text)
    assert (caught.value.place, kept.journal.exists()) == (str(kept.journal), True)
    assert "recover" in typed(caught.value.hint)
    assert kept.node.pending.suspicions == {CHANGE: caught.value.text}
    kept.fault("")
    with pytest.raises(SafetyRefusal):
        prepare_store(kept.node)


def test_a_fault_meanwhile_is_told_with_what_became_of_it(kept: KeptBench) -> None:
    canary, before = written(kept)
    fault = NoAnswer("no boot-up", state="unknown")
    canary.roll_back_after(fault)
    assert fault.details == [("changed", f"{canary.place.text}: rolled back, read back equal")]
    assert (fault.state, kept.node.pdos()) == ("unknown", before)
    again, _ = written(kept)
    again.roll_back_after(KeyboardInterrupt())
    assert kept.node.pdos() == before


def test_a_fault_meanwhile_after_which_it_is_still_there_is_left_changed(kept: KeptBench) -> None:
    canary, _ = written(kept)
    silent_for_good(kept)
    fault = NoAnswer("no boot-up", state="unknown")
    with pytest.raises(LeftChanged) as caught:
        canary.roll_back_after(fault)
    assert (caught.value.state, caught.value.exit_code, caught.value.__cause__) == ("left_changed", 7, fault)
    assert (caught.value.why or "").startswith(f"no boot-up; then {canary.place.text}")
    assert "recover" in typed(caught.value.hint)
    with pytest.raises(LeftChanged) as caught:
        canary.roll_back_after(KeyboardInterrupt())
    assert isinstance(caught.value.__cause__, KeyboardInterrupt)


def test_one_that_was_changed_before_something_failed_is_put_back_at_once(kept: KeptBench) -> None:
    before = kept.node.pdos()
    kept.bus.when_started = NoAnswer("no answer", node=NODE)

    def restart(_progress: object) -> None:
        kept.bus.heard_boot_ups += 1

    kept.node.on_step = restart
    with pytest.raises(DvtcliError) as caught:
        choose_canary(kept.node, before)
    assert kept.node.pdos() == before
    assert any(text.endswith("rolled back, read back equal") for _, text in caught.value.details)

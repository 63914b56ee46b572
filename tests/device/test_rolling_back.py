"""The way back of a transaction: in the opposite order, and believed only once it was read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from dvtcli.device.change.journal import JournalFolder
from dvtcli.device.change.roll_back import roll_back_once, roll_back_patiently
from dvtcli.device.node import Node
from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.abort import Abort
from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry
from dvtcli.domain.plan import PdoChange, Plan, Step, ValueChange, plan_pdo
from dvtcli.domain.ports import SdoReader, SdoTransport
from dvtcli.errors import DeviceRefused, LeftChanged, SdoAborted
from dvtcli.files.eds.reader import read_eds
from tests.laws.bench import (
    NODE,
    DirectBus,
    DirectSdo,
    FaultySdo,
    InstantClock,
    NeverRestarts,
    booted,
    dictionary,
    ignore,
    refuse,
    transaction,
)
from tests.small_eds import INPUTS, OUTPUTS, communication, mapping, plain

TPDO1, TPDO2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")


def timers(sdo: DirectSdo, timer_ms: int, *pdos: Pdo) -> Plan:
    """The plan that gives each of *pdos* this event timer."""
    changes = []
    for pdo in pdos:
        now = read_pdo(sdo, pdo)
        want = now.with_parameters(event_timer=timer_ms)
        changes.append(plan_pdo(pdo, now, want))
    return Plan(NODE, tuple(changes))


def test_the_last_change_is_taken_back_first() -> None:
    """What a later change stood on must be there until that one is gone."""
    sdo = DirectSdo(booted())
    heartbeat = ValueChange(Step(0x1017, 0, sdo.upload(0x1017, 0), (1234).to_bytes(2, "little"), "heartbeat"))
    never = ValueChange(Step(0x1006, 0, bytes(4), (1000).to_bytes(4, "little"), "refused"))
    plan = Plan(NODE, (*timers(sdo, 77, TPDO1, TPDO2).changes, heartbeat, never))
    with pytest.raises(DeviceRefused) as caught:
        transaction(FaultySdo(sdo, refuse, 4), plan).run()
    assert caught.value.state == "rolled_back"
    assert [index for index, _, _ in sdo.writes] == [0x1800, 0x1801, 0x1017, 0x1017, 0x1801, 0x1800]


def refuse_then_ignore(at: int) -> type[FaultySdo]:
    """A device that refuses the *at*-th write, and acknowledges every later one without taking it."""

    class Deaf(FaultySdo):
        def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
            self.fault = refuse if self.count + 1 == at else ignore
            super().download(index, sub_index, data, timeout_s=timeout_s)

    return Deaf


@pytest.mark.parametrize("kind", ["PDO", "value"])
def test_a_way_back_that_was_acknowledged_and_not_taken_is_left_changed(kind: str) -> None:
    sdo = DirectSdo(booted())
    before = sdo.upload(0x1017, 0)
    value = ValueChange(Step(0x1017, 0, before, (1234).to_bytes(2, "little"), "heartbeat"))
    pdos = timers(sdo, 77, TPDO1, TPDO2).changes
    plan = Plan(NODE, pdos if kind == "PDO" else (value, pdos[0]))
    with pytest.raises(LeftChanged) as caught:
        transaction(refuse_then_ignore(2)(sdo, refuse, 2, True), plan).run()
    assert (caught.value.state, caught.value.exit_code) == ("left_changed", 7)
    if kind == "PDO":
        assert read_pdo(sdo, TPDO1).communication.event_timer == 77
        assert "TPDO1 does not read back as it was" in str(caught.value.why)
    else:
        assert sdo.upload(0x1017, 0) == value.step.after != before
        assert "1017:00 does not read back as it was" in str(caught.value.why)


def odd_device() -> DirectSdo:
    """TPDO1 is enabled with a count above its entries; RPDO1 is enabled and empty."""
    eds = plain()
    eds.record(0x1800, "Communication", communication(0x181))
    eds.record(0x1A00, "Mapping", mapping(9, [INPUTS << 16 | 0x0108, INPUTS << 16 | 0x0208]))
    eds.record(0x1600, "Mapping", mapping(0, [0, 0]))
    path = Path("odd.eds")
    path.write_text(eds.text())
    return DirectSdo(booted("generic", read_eds(path).dictionary))


@pytest.mark.parametrize("pdo", ["tpdo1", "rpdo1"])
@pytest.mark.parametrize("steps", range(7))
def test_a_journal_puts_back_what_the_device_takes_wherever_the_change_was_killed(pdo: str, steps: int) -> None:
    sdo, one = odd_device(), Pdo.parse(pdo)
    before = read_pdo(sdo, one)
    assert bool(before.inconsistency) is one.is_tpdo
    entry = PdoMappingEntry((INPUTS if one.is_tpdo else OUTPUTS), 3, 8)
    back = PdoConfig(before.disabled().communication, ())
    change = plan_pdo(one, before, PdoConfig(before.communication, (entry,)))._replace(substitute=back)
    journals = JournalFolder(Path("journals").resolve(), "direct")
    journals.write(Plan(NODE, (change,)), {}, None)
    for step in change.steps[:steps]:
        sdo.download(step.index, step.sub_index, step.after)
    found = journals.find(NODE)
    assert found is not None
    otherwise = roll_back_patiently(sdo, found.plan.changes, InstantClock(), lambda: None, NeverRestarts())
    held = read_pdo(sdo, one)
    assert held in (before, back)
    assert [change.pdo for change in otherwise] == ([] if held == before else [one])
    assert steps > 0 or held == before


def refuse_for_its_state(_inner: SdoTransport, index: int, sub_index: int, _data: bytes) -> None:
    """The device says that it cannot at the moment."""
    raise SdoAborted(index, sub_index, Abort.DEVICE_STATE, node=NODE)


def with_weaker_way_back(sdo: SdoReader) -> PdoChange:
    """TPDO1 gets another mapping; it was foreseen that its present one is not taken back."""
    before = read_pdo(sdo, TPDO1)
    want = replace(before, mapping=(PdoMappingEntry(0x606C, 0, 32),))
    return plan_pdo(TPDO1, before, want)._replace(substitute=PdoConfig(before.disabled().communication, ()))


@pytest.mark.parametrize("at", range(1, 6))
def test_a_refusal_that_passes_leads_to_no_weaker_way_back(at: int) -> None:
    sdo = DirectSdo(booted())
    change = with_weaker_way_back(sdo)
    for step in change.steps:
        sdo.download(step.index, step.sub_index, step.after)
    faulty = FaultySdo(sdo, refuse_for_its_state, at)
    assert roll_back_patiently(faulty, [change], InstantClock(), lambda: None, NeverRestarts()) == ()
    assert faulty.count > at
    assert read_pdo(sdo, TPDO1) == change.before


@pytest.mark.parametrize("at", range(1, 6))
def test_nor_does_undo_take_one_for_the_device_s_answer(at: int) -> None:
    sdo = DirectSdo(booted())
    faulty = FaultySdo(sdo, refuse_for_its_state, 0)
    node = Node(DirectBus(sdo.device, faulty), NODE, dictionary("generic"))
    change = with_weaker_way_back(sdo)
    node.apply(Plan(NODE, (change,)))
    node.history = [replace(plan, changes=(change,)) for plan in node.history]
    faulty.count, faulty.at = 0, at
    applied = node.undo()
    assert faulty.count > at
    assert applied.not_put_back == ()
    assert read_pdo(sdo, TPDO1) == change.before


class AlwaysBusy(DirectSdo):
    """A device that gives its state as the reason of every refusal."""

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        try:
            super().download(index, sub_index, data, timeout_s=timeout_s)
        except SdoAborted:
            refuse_for_its_state(self, index, sub_index, data)


def test_a_refusal_that_lasts_leads_there_whatever_reason_it_gives() -> None:
    sdo = AlwaysBusy(odd_device().device)
    before = read_pdo(sdo, TPDO1)
    back = PdoConfig(before.disabled().communication, ())
    entry = PdoMappingEntry(INPUTS, 3, 8)
    change = plan_pdo(TPDO1, before, PdoConfig(before.communication, (entry,)))._replace(substitute=back)
    for step in change.steps:
        sdo.download(step.index, step.sub_index, step.after)
    assert roll_back_patiently(sdo, [change], InstantClock(), lambda: None, NeverRestarts()) == (change,)
    assert read_pdo(sdo, TPDO1) == back


def test_an_entry_behind_the_count_goes_back_with_its_pdo_whose_count_is_in_its_way() -> None:
    sdo = DirectSdo(booted())
    sdo.download(0x1800, 1, (0xC000_0181).to_bytes(4, "little"))
    before = read_pdo(sdo, TPDO1)
    want = before.with_parameters(event_timer=77)
    old, new = sdo.upload(0x1A00, 2), (0x606C_0020).to_bytes(4, "little")
    assert (len(before.mapping), old != new) == (1, True)
    unknown = ValueChange(Step(0x1A00, 4, None, new, "write-only, as it was said"))
    entry = ValueChange(Step(0x1A00, 2, old, new, "after the count"))
    sdo.download(0x1800, 5, (77).to_bytes(2, "little"))
    for sub_index, data in ((0, b"\0"), (2, new), (0, b"\1")):
        sdo.download(0x1A00, sub_index, data)
    sdo.writes.clear()
    assert roll_back_once(sdo, [plan_pdo(TPDO1, before, want), entry, unknown], is_last_try=False) == ()
    assert (read_pdo(sdo, TPDO1), sdo.upload(0x1A00, 2)) == (before, old)
    assert not [place for *place, _ in sdo.writes if place == [0x1A00, 4]]


def test_what_is_refused_and_has_no_other_way_is_raised_as_it_was_said() -> None:
    """A COB-ID that is refused is none of the parameters that a device may take while the PDO is off."""
    sdo = DirectSdo(booted())
    before = read_pdo(sdo, TPDO1)
    want = replace(before, mapping=(PdoMappingEntry(0x606C, 0, 32),))
    change = plan_pdo(TPDO1, before, want)
    for step in change.steps:
        sdo.download(step.index, step.sub_index, step.after)
    sdo.writes.clear()
    with pytest.raises(SdoAborted) as caught:
        roll_back_once(FaultySdo(sdo, refuse, 1), [change], is_last_try=True)
    assert (caught.value.place, sdo.writes) == ("1800:01", [])


class FixedEntries(DirectSdo):
    """A device whose mappings have a count that can be written, and entries that cannot, whatever its file says."""

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        if index == TPDO1.mapping_index and sub_index:
            self.writes.append((index, sub_index, bytes(data)))
            raise SdoAborted(index, sub_index, Abort.READ_ONLY, node=NODE)
        super().download(index, sub_index, data, timeout_s=timeout_s)


def test_entries_that_take_nothing_are_put_back_by_the_count_alone() -> None:
    device = booted()
    channel = FixedEntries(device)
    node = Node(DirectBus(device, channel), NODE, dictionary("generic"))
    before = node.pdos()
    with pytest.raises(DeviceRefused) as caught:
        node.configure({TPDO1: replace(before[TPDO1], mapping=(PdoMappingEntry(0x6064, 0, 32),))})
    assert (caught.value.state, caught.value.abort) == ("rolled_back", Abort.READ_ONLY)
    assert node.pdos() == before
    assert (0x1A00, 0, b"\1") in channel.writes, "its count was 0 meanwhile"


class Amnesiac(FixedEntries):
    """Such a device that forgets its entries when the count becomes 0, so that nothing brings them back."""

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        super().download(index, sub_index, data, timeout_s=timeout_s)
        if (index, sub_index, data) == (TPDO1.mapping_index, 0, b"\0"):
            self.device.set_value(TPDO1.mapping_index, 1, bytes(4))


def test_entries_that_are_gone_are_not_taken_for_put_back() -> None:
    device = booted()
    node = Node(DirectBus(device, Amnesiac(device)), NODE, dictionary("generic"))
    wanted = replace(node.pdos()[TPDO1], mapping=(PdoMappingEntry(0x6064, 0, 32),))
    with pytest.raises(LeftChanged):
        node.configure({TPDO1: wanted})

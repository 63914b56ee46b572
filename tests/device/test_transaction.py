"""A transaction step by step: what it says of a fault, when it puts back, and how long it tries."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.cancellation import Cancellation
from dvtcli.device.change.failed_change import step_line
from dvtcli.device.change.roll_back import PATIENCE_S, RETRY_S, first_difference
from dvtcli.device.change.untouched_pdos import UntouchedPdos
from dvtcli.device.read_pdos import read_cob_id, read_pdo
from dvtcli.domain.pdo import Pdo, PdoMappingEntry
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, ValueChange, plan_pdo
from dvtcli.domain.ports import SdoTransport
from dvtcli.errors import (
    BusUnavailable,
    DeviceRefused,
    DvtcliError,
    Interrupted,
    LeftChanged,
    NoAnswer,
    SdoAborted,
    SdoProtocolError,
)
from tests.laws.bench import (
    NODE,
    DirectSdo,
    Fault,
    FaultySdo,
    InstantClock,
    booted,
    correct,
    ignore,
    interrupt_after,
    lose_answer,
    lose_request,
    refuse,
    transaction,
)

TPDO1, TPDO2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")
HEARTBEAT = (0x1017, 0)


@pytest.fixture
def sdo() -> DirectSdo:
    return DirectSdo(booted())


def value(sdo: DirectSdo, number: int) -> ValueChange:
    """The producer heartbeat time becomes *number* ms."""
    before = sdo.upload(*HEARTBEAT)
    return ValueChange(Step(*HEARTBEAT, before, number.to_bytes(2, "little"), "heartbeat"))


def moved(sdo: DirectSdo, pdo: Pdo, can_id: int) -> PdoChange:
    now = read_pdo(sdo, pdo)
    cob_id = replace(now.communication.cob_id, can_id=can_id)
    return plan_pdo(pdo, now, now.with_parameters(cob_id=cob_id))


def refused_bus(_inner: SdoTransport, _index: int, _sub_index: int, _data: bytes) -> None:
    error = BusUnavailable("down", state="unchanged")
    error.details.append(("driver", "gone"))
    raise error


def run(sdo: SdoTransport, *changes: Change, clock: InstantClock | None = None, **how: Any) -> None:
    transaction(sdo, Plan(NODE, changes), clock=clock or InstantClock(), **how).run()


def failed(sdo: SdoTransport, *changes: Change, **how: Any) -> DvtcliError:
    with pytest.raises(DvtcliError) as caught:
        run(sdo, *changes, **how)
    return caught.value


def test_a_refusal_names_the_step_and_what_was_to_be_written(sdo: DirectSdo) -> None:
    explained: list[SdoAborted] = []
    change = moved(sdo, TPDO1, 0x1A1)
    error = failed(FaultySdo(sdo, refuse, 3), value(sdo, 1000), change, explain=explained.append)
    assert isinstance(error, DeviceRefused)
    assert str(error) == f"node {NODE} refused step 3 of 3 of TPDO1"
    assert (error.place, error.abort, error.state, error.node) == ("1800:01", 0x0800_0021, "rolled_back", NODE)
    assert error.details == [("step", step_line(change.steps[1]))]
    assert [one.code for one in explained] == [0x0800_0021]


def test_a_lost_answer_names_the_step_first_and_is_put_back(sdo: DirectSdo) -> None:
    before = sdo.upload(*HEARTBEAT)
    taken: list[Step] = []
    change = value(sdo, 1000)
    error = failed(FaultySdo(sdo, lose_answer, 1), change, on_step=taken.append)
    assert (error.details[0], error.state, taken) == (("step", step_line(change.step)), "rolled_back", [])
    assert sdo.upload(*HEARTBEAT) == before


def test_what_never_left_is_not_put_back_but_what_went_before_it_is(sdo: DirectSdo) -> None:
    change = value(sdo, 1000)
    error = failed(FaultySdo(sdo, refused_bus, 1), change)
    assert (error.state, sdo.writes) == ("unchanged", [])
    error = failed(FaultySdo(sdo, refused_bus, 2), change, moved(sdo, TPDO1, 0x1A1))
    assert (error.state, error.node) == ("rolled_back", NODE)
    assert [label for label, _ in error.details] == ["step", "driver"]
    assert sdo.writes[-1] == (*HEARTBEAT, change.step.before)


@pytest.mark.parametrize(("taken", "writes"), [(0, 0), (1, 2), (2, 4)])
def test_a_stop_is_obeyed_before_the_first_step_between_two_and_before_it_is_complete(
    sdo: DirectSdo, taken: int, writes: int
) -> None:
    cancellation = Cancellation()
    cancellation.requested, cancellation.exit_code = not taken, 143
    steps: list[Step] = []

    def on_step(step: Step) -> None:
        steps.append(step)
        cancellation.requested = len(steps) == taken

    error = failed(sdo, moved(sdo, TPDO1, 0x1A1), cancellation=cancellation, on_step=on_step)
    assert isinstance(error, Interrupted)
    assert str(error) == f"stopped after step {taken} of 2"
    assert (error.exit_code, error.node) == (143, NODE)
    assert Interrupted.exit_code == 130
    assert len(sdo.writes) == writes


def test_a_stop_while_it_is_read_back_is_the_last_that_is_obeyed(sdo: DirectSdo) -> None:
    cancellation, change = Cancellation(), value(sdo, 1000)

    class Stopped(DirectSdo):
        def upload(self, *place: int, **how: Any) -> bytes:
            cancellation.requested = True
            return super().upload(*place, **how)

    error = failed(Stopped(sdo.device), change, cancellation=cancellation)
    assert str(error) == "stopped after step 1 of 1"
    assert sdo.upload(*HEARTBEAT) == change.step.before


@pytest.mark.parametrize(("fault", "state"), [(lose_request, "unknown"), (refuse, "rolled_back")])
def test_what_a_write_only_object_holds_after_a_lost_answer_is_not_known(
    sdo: DirectSdo, fault: Fault, state: str
) -> None:
    blind = ValueChange(Step(0x2005, 1, None, b"\x01", "write-only"))
    assert failed(FaultySdo(sdo, fault, 1), blind).state == state
    assert failed(FaultySdo(sdo, fault, 2), value(sdo, 5), blind).state == state
    assert failed(FaultySdo(sdo, fault, 1), value(sdo, 5), blind).state == "rolled_back", "it was never begun"


@dataclass
class Restarts:
    """A witness of one restart, after *looks* questions, or of one more at each."""

    looks: int
    always: bool = False
    asked: int = 0

    def boot_ups(self) -> int:
        self.asked += 1
        return self.asked if self.always else int(self.asked > self.looks)

    def disturbance_count(self) -> int:
        return self.boot_ups()


def test_a_difference_is_laid_to_a_restart_only_where_there_was_one(sdo: DirectSdo) -> None:
    error = failed(FaultySdo(sdo, ignore, 1), value(sdo, 1000))
    assert str(error) == f"node {NODE} took 1017:00 without an error, but reads back differently"
    assert typed(error.hint) == "the device corrects or ignores the value: check its valid values in the manual"
    error = failed(FaultySdo(sdo, ignore, 1), value(sdo, 1000), reboot_monitor=Restarts(-1))
    assert "took 1017:00 without an error" in str(error), "it restarted before the change only"
    error = failed(FaultySdo(sdo, ignore, 1), value(sdo, 1000), reboot_monitor=Restarts(1))
    assert str(error) == f"node {NODE} restarted while 1017:00 was changed, and reads back differently"
    assert typed(error.hint) == "check its supply, then try again"
    assert (error.place, error.why) == ("1017:00", "0x1017:00 is 0x01F4, expected 0x03E8")


def test_what_was_so_already_and_is_lost_meanwhile_is_a_difference_too(sdo: DirectSdo) -> None:
    now = read_pdo(sdo, TPDO1)
    lost = now.disabled()
    error = failed(sdo, PdoChange(TPDO1, lost, lost, ()))
    assert error.place == "TPDO1"


def test_a_device_that_restarts_each_time_it_is_put_back_proves_nothing(sdo: DirectSdo) -> None:
    clock = InstantClock()

    class Slow(DirectSdo):
        def upload(self, *place: int, **how: Any) -> bytes:
            clock.sleep(1.0)
            return super().upload(*place, **how)

    change = value(sdo, 1000)
    error = failed(FaultySdo(Slow(sdo.device), refuse, 1), change, clock=clock, reboot_monitor=Restarts(0, always=True))
    assert isinstance(error, LeftChanged)
    assert "the node restarted, or lost an answer, each time that it was rolled back" in str(error.why)
    assert clock.now_s() >= PATIENCE_S


def silent_after(sdo: DirectSdo, writes: int, silences: int) -> SdoTransport:
    """A device that says nothing for *silences* requests once *writes* writes were taken."""

    class Silent(DirectSdo):
        left = silences

        def upload(self, *place: int, **how: Any) -> bytes:
            self._hush()
            return super().upload(*place, **how)

        def download(self, *place: Any, **how: Any) -> None:
            self._hush()
            super().download(*place, **how)

        def _hush(self) -> None:
            if len(self.writes) >= writes and self.left:
                self.left -= 1
                raise NoAnswer("silent", state="unknown")

    return Silent(sdo.device)


def test_a_node_that_is_silent_for_a_while_is_asked_again(sdo: DirectSdo) -> None:
    clock, retries = InstantClock(), []
    change = moved(sdo, TPDO1, 0x1A1)
    error = failed(silent_after(sdo, 1, 4), change, clock=clock, before_retry=lambda: retries.append(clock.now_s()))
    assert error.state == "rolled_back"
    assert retries == pytest.approx([RETRY_S, 2 * RETRY_S, 3 * RETRY_S])
    assert read_pdo(sdo, TPDO1) == change.before


def test_a_node_that_stays_silent_is_left_changed_when_patience_ends(sdo: DirectSdo) -> None:
    clock, change = InstantClock(), moved(sdo, TPDO1, 0x1A1)
    error = failed(silent_after(sdo, 1, 10_000), change, clock=clock)
    assert (type(error), error.state) == (LeftChanged, "left_changed")
    assert error.why == "silent; then, while rolling back: silent"
    assert PATIENCE_S <= clock.now_s() < PATIENCE_S + 2 * RETRY_S


def test_what_is_refused_on_the_way_back_is_told_with_the_device_s_reason(sdo: DirectSdo) -> None:
    error = failed(FaultySdo(sdo, refuse, 2, forever=True), value(sdo, 1000), moved(sdo, TPDO1, 0x1A1))
    assert isinstance(error, LeftChanged)
    after = str(error.why).partition("; then, while rolling back: ")[2]
    assert "0x08000021" in after, "not only that it does not read back"


def altering(sdo: DirectSdo, times: int) -> SdoTransport:
    """A device that moves TPDO2 to 0x281 whenever TPDO1 is enabled, *times* times."""

    class Altering(DirectSdo):
        left = times

        def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
            super().download(index, sub_index, data, timeout_s=timeout_s)
            if (index, sub_index, data[3] >> 7) == (0x1800, 1, 0) and self.left:
                self.left -= 1
                for word in (0xC000_0281, 0x4000_0281):
                    self.device.download(0x1801, 1, word.to_bytes(4, "little"))

    return Altering(sdo.device)


def enabled(sdo: DirectSdo) -> PdoChange:
    """TPDO1, which is made to be off, is switched on."""
    run(sdo, moved(sdo, TPDO2, 0x2B1))
    now = read_pdo(sdo, TPDO1)
    off = now.disabled()
    run(sdo, plan_pdo(TPDO1, now, off))
    on = now.with_parameters(cob_id=now.communication.cob_id.enabled())
    return plan_pdo(TPDO1, off, on)


def test_another_pdo_that_the_device_moves_along_is_told_and_put_back(sdo: DirectSdo) -> None:
    change, told = enabled(sdo), []
    configs = {TPDO2: read_pdo(sdo, TPDO2)}
    others = {TPDO2: configs[TPDO2].communication.cob_id}
    note: Callable[[Sequence[Change]], None] = lambda changes: told.append([one.label for one in changes])  # noqa: E731
    error = failed(altering(sdo, 1), change, others=UntouchedPdos(others, configs), on_altered=note)
    assert str(error) == f"node {NODE} took TPDO1, but changed TPDO2 as a side effect"
    assert (error.place, error.state, error.state_text) == ("1801:01", "rolled_back", None)
    assert error.why == f"0x1801:01 was 0x{others[TPDO2].raw:08X}, is 0x40000281"
    assert told == [["TPDO1", "TPDO2"]]
    assert {TPDO2: read_pdo(sdo, TPDO2), TPDO1: read_pdo(sdo, TPDO1)} == {**configs, TPDO1: change.before}


def test_of_one_that_was_not_read_whole_the_cob_id_is_put_back_and_that_is_said(sdo: DirectSdo) -> None:
    change, before = enabled(sdo), read_pdo(sdo, TPDO2)
    error = failed(altering(sdo, 1), change, others=UntouchedPdos({TPDO2: before.communication.cob_id}))
    assert (error.state, read_pdo(sdo, TPDO1), read_pdo(sdo, TPDO2)) == ("rolled_back", change.before, before)
    assert error.state_text == (
        "rolled back: TPDO1 is as it was, and TPDO2 has its COB-ID again, read back equal; the rest of it was not "
        "read before: check it"
    )


def test_one_that_is_only_in_the_way_is_not_looked_at(sdo: DirectSdo) -> None:
    """A plan that writes no COB-ID moves none."""
    others = {TPDO2: read_cob_id(sdo, TPDO2)}
    sdo.reads.clear()
    run(sdo, value(sdo, 1000), others=UntouchedPdos(others))
    assert (0x1801, 1) not in sdo.reads
    change = enabled(sdo)
    run(altering(sdo, 1), change, others=UntouchedPdos())
    assert read_pdo(sdo, TPDO1) == change.after


def test_after_a_restart_nobody_knows_whether_others_were_altered(sdo: DirectSdo) -> None:
    """Nothing is laid to the device then; and nothing is called done."""
    change = enabled(sdo)
    error = failed(
        altering(sdo, 1), change, others=UntouchedPdos({TPDO2: read_cob_id(sdo, TPDO2)}), reboot_monitor=Restarts(1)
    )
    assert str(error) == f"node {NODE} restarted while TPDO1 was changed"
    assert error.state == "rolled_back"
    assert read_pdo(sdo, TPDO1) == change.before
    run(sdo, value(sdo, 1000), others=UntouchedPdos({TPDO2: read_cob_id(sdo, TPDO2)}), reboot_monitor=Restarts(1))
    run(sdo, change, others=UntouchedPdos(), reboot_monitor=Restarts(1))
    assert read_pdo(sdo, TPDO1) == change.after


@pytest.mark.parametrize(
    ("data", "text"),
    [
        ("01", "0x01"),
        ("0102", "0x0201"),
        ("01020304", "0x04030201"),
        ("0102030405", "01 02 03 04 05"),
        ("0a" * 17, "0A 0A 0A 0A … 17 bytes"),
    ],
)
def test_a_step_is_a_number_as_long_as_it_fits_one(data: str, text: str) -> None:
    assert step_line(Step(0x2000, 1, None, bytes.fromhex(data), "why")) == f"0x2000:01 <- {text}    why"


def test_a_difference_is_told_by_what_says_most(sdo: DirectSdo) -> None:
    now = read_pdo(sdo, TPDO1)
    assert first_difference(sdo, plan_pdo(TPDO1, now, now)) is None
    wider = replace(now, mapping=(*now.mapping, PdoMappingEntry.from_raw(0x6041_0010)))
    change = plan_pdo(TPDO1, now, wider)
    count = len(now.mapping)
    assert first_difference(sdo, change) == f"0x1A00:00 is 0x{count:02X}, expected 0x00"
    assert first_difference(sdo, change, wanted_before=True) is None
    only_id = moved(sdo, TPDO1, 0x1A1)
    held, wanted = (one.communication.cob_id.raw for one in (now, only_id.after))
    assert first_difference(sdo, only_id) == f"0x1800:01 is 0x{held:08X}, expected 0x{wanted:08X}"
    assert first_difference(sdo, ValueChange(Step(0x2005, 1, None, b"\x01", "write-only"))) is None
    one = value(sdo, 1000)
    assert first_difference(sdo, one) == "0x1017:00 is 0x01F4, expected 0x03E8"
    assert first_difference(sdo, one, wanted_before=True) is None


def test_a_corrected_write_is_a_refusal(sdo: DirectSdo) -> None:
    error = failed(FaultySdo(sdo, correct, 1), value(sdo, 1000))
    assert (type(error), error.state) == (DeviceRefused, "rolled_back")


class Life:
    """A witness of a node whose boot-ups are counted by whoever causes them."""

    received = 0

    def boot_ups(self) -> int:
        return self.received

    def disturbance_count(self) -> int:
        return self.received


@pytest.mark.parametrize(
    ("why", "restarts", "told", "hint"),
    [
        (
            None,
            False,
            "it answers again: a request or answer was lost or late, or it restarted unnoticed",
            "try again; if it fails again",
        ),
        ("no acknowledgement", False, "no acknowledgement", "try again; if it fails again"),
        (
            None,
            True,
            "it restarted during the check: its boot-up message was received",
            "check its supply, then try again",
        ),
    ],
)
def test_a_node_that_answers_again_is_not_said_to_be_off(
    sdo: DirectSdo, why: str | None, restarts: bool, told: str, hint: str
) -> None:
    life = Life()

    def lose(_inner: SdoTransport, index: int, sub_index: int, _data: bytes) -> None:
        life.received += restarts
        raise NoAnswer(
            "silent", node=NODE, place=f"{index:04X}:{sub_index:02X}", why=why, hint="is it on?", state="unknown"
        )

    error = failed(FaultySdo(sdo, lose, 1), value(sdo, 1000), reboot_monitor=life)
    assert (error.state, error.why) == ("rolled_back", told)
    assert typed(error.hint).startswith(hint)


@pytest.mark.parametrize(
    ("hint", "told"), [(None, "there may be two nodes with one node-ID"), ("look there", "look there")]
)
def test_an_answer_that_is_none_names_what_may_have_sent_it(sdo: DirectSdo, hint: str | None, told: str) -> None:
    def garble(_inner: SdoTransport, index: int, sub_index: int, _data: bytes) -> None:
        raise SdoProtocolError(
            "toggle bit", node=NODE, place=f"{index:04X}:{sub_index:02X}", hint=hint, state="unknown"
        )

    error = failed(FaultySdo(sdo, garble, 1), value(sdo, 1000))
    assert error.state == "rolled_back"
    assert typed(error.hint).startswith(told)


def test_who_insists_ends_it_at_once_with_the_signal_s_exit_code_and_the_device_as_it_was(sdo: DirectSdo) -> None:
    cancellation, change = Cancellation(), value(sdo, 1000)
    cancellation.exit_code = 143
    error = failed(FaultySdo(sdo, interrupt_after, 2), change, moved(sdo, TPDO1, 0x1A1), cancellation=cancellation)
    assert isinstance(error, Interrupted)
    assert str(error) == "stopped at once, in step 2 of 3"
    assert (error.exit_code, error.state, error.node) == (143, "rolled_back", NODE)
    assert sdo.upload(*HEARTBEAT) == change.step.before

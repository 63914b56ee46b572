"""What a device may leave out or answer oddly, and what storing it takes."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.cancellation import Cancellation
from dvtcli.device.nmt_gate import Gate, NodeAccess
from dvtcli.device.read_pdos import exists, read_pdo
from dvtcli.device.resets import reset_and_wait
from dvtcli.device.store.store_parameters import write_signature
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.objects import RESTORE_PARAMETERS, STORE_PARAMETERS
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import DeviceRefused, SafetyRefusal, SdoAborted, SdoProtocolError
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, profile

TPDO1, RPDO1 = Pdo.parse("tpdo1"), Pdo.parse("rpdo1")
Values = dict[tuple[int, int], bytes]


@dataclass
class Table:
    """A device that answers from a table, and with 06090011 for all else."""

    values: Values
    reads: list[tuple[int, int]] = field(default_factory=list)

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        self.reads.append((index, sub_index))
        if (index, sub_index) not in self.values:
            raise SdoAborted(index, sub_index, 0x06090011)
        return self.values[index, sub_index]

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        raise AssertionError("reading wrote something")


def test_a_pdo_may_have_its_cob_id_alone() -> None:
    table = Table({(0x1400, 1): b"\x01\x02\0\0", (0x1600, 0): b"\0"})
    config = read_pdo(table, RPDO1)
    parameter = config.communication
    assert parameter.cob_id.raw == 0x201
    assert (parameter.transmission_type, parameter.inhibit_time, parameter.event_timer) == (None, None, None)
    assert config.mapping == ()


@pytest.mark.parametrize("family", ["generic", "gen4", "espac", "tmcm", "roboteq"])
def test_sub_index_4_is_never_touched(family: str) -> None:
    sdo = DirectSdo(booted(family))
    for pdo in (TPDO1, RPDO1):
        read_pdo(sdo, pdo)
    assert not [place for place in sdo.reads if place[0] in (0x1400, 0x1800) and place[1] in (0, 4)]


def test_entries_behind_the_count_are_not_read() -> None:
    table = Table({(0x1800, 1): bytes(4), (0x1A00, 0): b"\1", (0x1A00, 1): b"\x10\0\x41\x60", (0x1A00, 2): b"\xff" * 4})
    assert [str(entry) for entry in read_pdo(table, TPDO1).mapping] == ["6041:00/16"]
    assert (0x1A00, 2) not in table.reads


@pytest.mark.parametrize("count", [0xFE, 0xFF])
def test_a_multiplexed_pdo_is_shown_by_its_count(count: int) -> None:
    config = read_pdo(Table({(0x1800, 1): bytes(4), (0x1A00, 0): bytes([count])}), TPDO1)
    assert (config.mpdo, config.count, config.mapping) == (count, count, ())


@pytest.mark.parametrize("count", [65, 200, 0xFD])
def test_an_impossible_count_is_kept_with_what_can_be_read(count: int) -> None:
    table = Table({(0x1800, 1): bytes(4), (0x1A00, 0): bytes([count]), (0x1A00, 1): b"\x10\0\x41\x60"})
    config = read_pdo(table, TPDO1)
    assert (config.held_count, config.count, config.unread) == (count, count, ((0x1A00, 2),))
    assert [str(entry) for entry in config.mapping] == ["6041:00/16"]


def test_half_a_pdo_is_one_and_none_of_both_is_none() -> None:
    sending = read_pdo(Table({(0x1800, 1): b"\x81\1\0\0"}), TPDO1)
    assert (sending.enabled, sending.has_cob_id, sending.has_mapping) == (True, True, False)
    mapped = read_pdo(Table({(0x1A00, 0): b"\0"}), TPDO1)
    assert (mapped.enabled, mapped.has_cob_id, mapped.has_mapping) == (False, False, True)
    with pytest.raises(SdoAborted):
        read_pdo(Table({}), TPDO1)


@pytest.mark.parametrize("answer", [b"", b"\1\2\3\4\5"])
def test_no_bytes_or_too_many_are_a_protocol_error(answer: bytes) -> None:
    with pytest.raises(SdoProtocolError):
        read_pdo(Table({(0x1800, 1): answer, (0x1A00, 0): b"\0"}), TPDO1)


def test_other_aborts_are_not_taken_for_absence() -> None:
    class Busy(Table):
        def upload(
            self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
        ) -> bytes:
            if sub_index == 3:
                raise SdoAborted(index, sub_index, 0x08000022)
            return super().upload(index, sub_index)

    with pytest.raises(SdoAborted):
        read_pdo(Busy({(0x1800, 1): bytes(4), (0x1A00, 0): b"\0"}), TPDO1)
    assert not exists(Table({}), TPDO1)


def access(family: str) -> tuple[NodeAccess, DirectBus]:
    bus = DirectBus.of(booted(family))
    return NodeAccess(bus, NODE, profile(family)), bus


@pytest.mark.parametrize("family", ["generic", "gen4", "espac", "tmcm"])
def test_a_store_survives_a_reset_and_an_unstored_change_does_not(family: str) -> None:
    reached, bus = access(family)
    raw = bus.sdo(NODE).upload(0x1800, 2)
    bus.sdo(NODE).download(0x1800, 2, b"\x0a")
    reset_and_wait(reached, NmtCommand.RESET_NODE)
    assert bus.sdo(NODE).upload(0x1800, 2) == raw
    bus.sdo(NODE).download(0x1800, 2, b"\x0a")
    done = write_signature(reached, profile(family).store, STORE_PARAMETERS, None, Cancellation())
    assert done.index == STORE_PARAMETERS
    reset_and_wait(reached, NmtCommand.RESET_NODE)
    assert bus.sdo(NODE).upload(0x1800, 2) == b"\x0a"
    write_signature(reached, profile(family).store, RESTORE_PARAMETERS, None, Cancellation())
    reset_and_wait(reached, NmtCommand.RESET_NODE)
    assert bus.sdo(NODE).upload(0x1800, 2) == raw


def test_a_device_without_0x1010_cannot_store() -> None:
    reached, bus = access("roboteq")
    with pytest.raises(DeviceRefused) as caught:
        write_signature(reached, profile("roboteq").store, STORE_PARAMETERS, None, Cancellation())
    assert "cannot store" in caught.value.text
    assert "2017" in typed(caught.value.hint)
    with pytest.raises(DeviceRefused) as other:
        write_signature(reached, profile("roboteq").store, RESTORE_PARAMETERS, None, Cancellation())
    assert "2017" not in typed(other.value.hint)
    assert isinstance(bus.channel, DirectSdo)
    assert bus.channel.writes == []


@pytest.mark.parametrize(("capability", "text"), [(2, "by itself"), (0, "does not store on command")])
def test_what_does_not_store_on_command_is_said(capability: int, text: str) -> None:
    reached, bus = access("generic")
    bus.device.set_value(STORE_PARAMETERS, 1, capability.to_bytes(4, "little"))
    with pytest.raises(DeviceRefused) as caught:
        write_signature(reached, profile("generic").store, STORE_PARAMETERS, None, Cancellation())
    assert text in (caught.value.why or "")


def test_a_broken_memory_is_a_refusal_with_its_code() -> None:
    reached, bus = access("generic")
    bus.device.areas.fails = True
    with pytest.raises(DeviceRefused) as caught:
        write_signature(reached, profile("generic").store, STORE_PARAMETERS, None, Cancellation())
    assert caught.value.abort == 0x06060000
    assert "memory" in typed(caught.value.hint)


def test_a_store_in_the_wrong_state_gives_the_device_s_reason() -> None:
    reached, bus = access("gen4")
    bus.device.nmt(NmtCommand.START)
    with pytest.raises(DeviceRefused) as caught:
        write_signature(reached, profile("gen4").store, STORE_PARAMETERS, None, Cancellation())
    assert caught.value.abort == 0x08000000
    assert "4" in (caught.value.why or "")
    assert "not pre-operational" in (caught.value.why or "")


def test_the_gate_asks_goes_and_comes_back_only_when_told() -> None:
    reached, bus = access("gen4")
    asked: list[str] = []
    gate = Gate(reached, asked.append)
    gate.enter()
    assert (asked, bus.commands) == ([], [])
    gate = Gate(reached, asked.append)
    bus.device.nmt(NmtCommand.START)
    gate.enter()
    gate.enter()
    assert len(asked) == 1
    assert bus.commands == [NmtCommand.ENTER_PRE_OPERATIONAL]
    assert bus.nmt_state(NODE) is NmtState.PRE_OPERATIONAL
    gate.leave()
    assert bus.nmt_state(NODE) is NmtState.OPERATIONAL
    gate.leave()
    assert bus.commands == [NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.START]


def test_a_gate_without_consent_leaves_the_node_alone() -> None:
    def refuse(_question: str) -> None:
        raise SafetyRefusal("no")

    reached, bus = access("gen4")
    bus.device.nmt(NmtCommand.START)
    with pytest.raises(SafetyRefusal):
        Gate(reached, refuse).enter()
    assert bus.device.state is NmtState.OPERATIONAL
    assert bus.commands == []


def test_a_stopped_node_is_refused_at_the_gate() -> None:
    reached, bus = access("gen4")
    bus.device.nmt(NmtCommand.STOP)
    with pytest.raises(SafetyRefusal) as caught:
        Gate(reached, lambda _question: None).enter()
    assert "STOPPED" in caught.value.text
    assert "nmt preop" in typed(caught.value.hint)


@pytest.mark.parametrize("family", ["generic", "tmcm", "roboteq"])
def test_families_that_need_no_gate_have_none(family: str) -> None:
    reached, bus = access(family)
    bus.device.nmt(NmtCommand.START)
    Gate(reached, pytest.fail).enter()
    assert bus.device.state is NmtState.OPERATIONAL

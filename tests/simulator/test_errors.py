"""EMCY frames, error register and history; the SYNC that a node produces."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.family import GENERIC
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_names
from tests.simulator.bench import Aborted, Client, booted


def quiet() -> StrictDevice:
    """A generic device in OPERATIONAL that sends nothing by itself."""
    device = booted()
    client = Client.on(device)
    client.write(0x1017, 0, 0, 2)
    for index in (0x1800, 0x1801, 0x1802, 0x1803):
        client.write(index, 1, 0xC0000000, 4)
    device.nmt(NmtCommand.START)
    return device


def emcy(code: int, register: int) -> Frame:
    return Frame(0x81, code.to_bytes(2, "little") + bytes([register]) + bytes(5))


def history(device: StrictDevice) -> list[int]:
    client = Client.on(device)
    return [client.number(0x1003, sub_index) for sub_index in range(client.number(0x1003) + 1)]


@pytest.mark.parametrize(
    ("code", "register"),
    [(0x1000, 0x01), (0x2310, 0x03), (0x3210, 0x05), (0x4210, 0x09), (0x8110, 0x11), (0xFF00, 0x81), (0x5000, 0x01)],
)
def test_the_error_register_shows_the_class_of_the_code(code: int, register: int) -> None:
    device = quiet()
    assert device.services.emergency(code) == [emcy(code, register)]
    assert Client.on(device).number(0x1001) == register


def test_an_error_is_sent_once_and_its_end_as_well() -> None:
    device = quiet()
    assert device.services.receive(Frame(0x201, b"\x1f")) == [emcy(0x8210, 0x11)]
    assert device.services.receive(Frame(0x201, b"\x1f")) == []
    assert device.services.receive(Frame(0x201, b"\x1f\x00\x00")) == [emcy(0x8220, 0x11)]
    assert device.services.receive(Frame(0x201, b"\x1f\x00")) == [emcy(0, 0)]
    assert device.services.receive(Frame(0x201, b"\x1f\x00")) == []
    assert Client.on(device).number(0x1001) == 0


def test_an_error_reset_tells_what_remains() -> None:
    device = quiet()
    device.services.emergency(0x4210)
    device.services.receive(Frame(0x201, b""))
    assert device.services.receive(Frame(0x201, b"\x1f\x00")) == [emcy(0, 0x09)]
    assert device.services.emergency(0) == [emcy(0, 0)]


def test_the_history_holds_the_latest_first_and_ends_where_the_dictionary_ends() -> None:
    device = quiet()
    last = device.dictionary[0x1003].entries.keys()
    assert max(last) == 1
    device.services.emergency(0x1000)
    assert history(device) == [1, 0x1000]
    device.services.emergency(0x2310)
    assert history(device) == [1, 0x2310]


def test_writing_0_clears_the_history_and_nothing_else_may_be_written() -> None:
    device = quiet()
    device.services.emergency(0x1000)
    client = Client.on(device)
    with pytest.raises(Aborted):
        client.write(0x1003, 0, 1, 1)
    client.write(0x1003, 0, 0, 1)
    assert history(device) == [0]
    assert client.number(0x1003, 1) == 0


def test_a_longer_history_shifts() -> None:
    known = booted().dictionary
    fields = known[0x1003].entries
    longer = replace(known[0x1003], entries=fields | {sub: replace(fields[1], sub_index=sub) for sub in (2, 3)})
    device = StrictDevice(ObjectDictionary({index: known[index] for index in known} | {0x1003: longer}), GENERIC, 1)
    device.boot_up()
    for code in (0x1000, 0x2310, 0x3210):
        device.services.emergency(code)
    assert history(device) == [3, 0x3210, 0x2310, 0x1000]


def test_the_inhibit_time_spaces_emergencies() -> None:
    device = quiet()
    Client.on(device).write(0x1015, 0, 1000, 2)  # 100 ms
    assert device.services.emergency(0x1000) == []
    device.services.emergency(0x2310)
    assert device.services.poll(1.0) == [emcy(0x1000, 0x01)]
    assert device.services.next_poll_s() == pytest.approx(1.1)
    assert device.services.poll(1.05) == []
    assert device.services.poll(1.1) == [emcy(0x2310, 0x03)]


def test_a_reset_forgets_errors() -> None:
    device = quiet()
    device.services.emergency(0x1000)
    device.nmt(NmtCommand.RESET_NODE)
    assert Client.on(device).number(0x1001) == 0
    assert device.services.emergency(0x1000) == [emcy(0x1000, 1)]


def test_no_emergency_while_stopped() -> None:
    device = quiet()
    device.nmt(NmtCommand.STOP)
    assert device.services.emergency(0x1000) == []


def producing(overflow: int = 0) -> StrictDevice:
    device = quiet()
    client = Client.on(device)
    client.write(0x1019, 0, overflow, 1)
    client.write(0x1006, 0, 10_000, 4)
    client.write(0x1005, 0, 0x40000080, 4)
    return device


def test_a_producer_sends_sync_and_its_own_tpdos() -> None:
    device = producing()
    client = Client.on(device)
    client.write(0x1800, 2, 2, 1)
    client.write(0x1800, 1, 0x40000181, 4)
    assert device.services.poll(1.0) == []
    assert device.services.next_poll_s() == pytest.approx(1.01)
    assert device.services.poll(1.01) == [Frame(0x80, b"")]
    assert device.services.poll(1.015) == []
    assert device.services.poll(1.02) == [Frame(0x80, b""), Frame(0x181, b"\x50\x02")]


def test_the_counter_runs_from_1_to_1019() -> None:
    device = producing(overflow=3)
    device.services.poll(1.0)
    counters = [frame.data[0] for step in range(101, 106) for frame in device.services.poll(step / 100)]
    assert counters == [1, 2, 3, 1, 2]


def test_sync_ends_with_bit_30_or_the_period_and_in_stopped() -> None:
    device = producing()
    device.services.poll(1.0)
    device.nmt(NmtCommand.STOP)
    assert device.services.poll(1.1) == []
    device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    assert device.services.poll(1.2) == [Frame(0x80, b"")]
    Client.on(device).write(0x1005, 0, 0x80, 4)
    assert device.services.poll(1.3) == []
    assert device.services.next_poll_s() is None


def test_the_sync_cob_id_stays_while_it_is_produced() -> None:
    client = Client.on(producing())
    client.write(0x1005, 0, 0x40000080, 4)
    with pytest.raises(Aborted, match="06090030"):
        client.write(0x1005, 0, 0x40000081, 4)
    client.write(0x1005, 0, 0x81, 4)


def watching(*times_ms: tuple[int, int]) -> StrictDevice:
    """A device in OPERATIONAL that waits for heartbeats: (node-ID, ms) each."""
    device = quiet()
    for sub_index, (node_id, time_ms) in enumerate(times_ms, 1):
        Client.on(device).write(0x1016, sub_index, node_id << 16 | time_ms, 4)
    return device


def beat(node_id: int) -> Frame:
    return Frame(0x700 + node_id, b"\x05")


def test_a_producer_is_watched_from_its_first_heartbeat_and_its_loss_ends_operational() -> None:
    device = watching((5, 100))
    assert device.services.poll(1.0) == []
    assert device.services.next_poll_s() is None
    assert device.services.hears(beat(5))
    assert not device.services.hears(beat(6))
    assert device.services.receive(beat(5)) == []
    assert device.services.poll(2.0) == []
    assert device.services.next_poll_s() == pytest.approx(2.1)
    device.services.receive(beat(5))
    assert device.services.poll(2.09) == []
    assert device.services.poll(2.2) == [emcy(0x8130, 0x11)]
    assert device.state is NmtState.PRE_OPERATIONAL
    assert device.services.poll(9.0) == []
    assert device.services.receive(beat(5)) == [emcy(0, 0)]


def test_a_reset_or_a_new_time_waits_for_heartbeats_anew() -> None:
    device = watching((5, 100))
    device.services.receive(beat(5))
    device.services.poll(1.0)
    Client.on(device).write(0x1016, 1, 0, 4)
    assert device.services.poll(2.0) == []
    assert not device.services.hears(beat(5))
    Client.on(device).write(0x1016, 1, 5 << 16 | 100, 4)
    device.services.receive(beat(5))
    device.services.poll(3.0)
    device.nmt(NmtCommand.RESET_NODE)
    device.take_outbox()
    assert emcy(0x8130, 0x11) not in device.services.poll(4.0)


def test_a_producer_has_one_time() -> None:
    known = booted().dictionary
    fields = known[0x1016].entries
    longer = replace(known[0x1016], entries=fields | {2: replace(fields[1], sub_index=2)})
    device = StrictDevice(ObjectDictionary({index: known[index] for index in known} | {0x1016: longer}), GENERIC, 1)
    device.boot_up()
    client = Client.on(device)
    client.write(0x1016, 1, 5 << 16 | 100, 4)
    client.write(0x1016, 1, 5 << 16 | 200, 4)
    client.write(0x1016, 2, 6 << 16 | 100, 4)
    with pytest.raises(Aborted, match="06040043"):
        client.write(0x1016, 2, 5 << 16 | 100, 4)
    client.write(0x1016, 2, 5 << 16, 4)


@pytest.mark.parametrize("family", family_names())
def test_there_is_no_node_guarding(family: str) -> None:
    device = booted(family)
    for index in (0x100C, 0x100D):
        with pytest.raises(Aborted, match="06020000"):
            Client.on(device).read(index)
        with pytest.raises(Aborted, match="06020000"):
            Client.on(device).write(index, 0, 100, 2 if index == 0x100C else 1)
    assert device.services.receive(Frame(0x701, b"", remote=True)) == []


def test_a_file_with_node_guarding_gets_none() -> None:
    known = booted().dictionary
    guard = {0x100C: replace(known[0x1017], index=0x100C), 0x100D: replace(known[0x1019], index=0x100D)}
    device = StrictDevice(ObjectDictionary({index: known[index] for index in known} | guard), GENERIC, 1)
    device.boot_up()
    client = Client.on(device)
    for index, size in ((0x100C, 2), (0x100D, 1)):
        client.write(index, 0, 0, size)
        with pytest.raises(Aborted, match="06090030"):
            client.write(index, 0, 100, size)

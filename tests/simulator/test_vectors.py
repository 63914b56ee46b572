"""The makers' worked examples: the right family takes them in the right order, and refuses what is out of order."""

from __future__ import annotations

import pytest

from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import Frame
from tests.simulator.bench import Aborted, Client, booted

Write = tuple[int, int, int, int]

# Trinamic AN076 V1.00, examples 4.1 and 4.2, as the steps print them.
TMCM_RPDO3: list[Write] = [
    (0x1402, 1, 0xC0000401, 4),
    (0x1602, 0, 0x00, 1),
    (0x1602, 1, 0x607A0020, 4),
    (0x1602, 2, 0x27030120, 4),
    (0x1602, 0, 0x02, 1),
    (0x1402, 1, 0x40000401, 4),
]
TMCM_TPDO1: list[Write] = [
    (0x1800, 1, 0xC0000181, 4),
    (0x1A00, 0, 0x00, 1),
    (0x1A00, 1, 0x60410010, 4),
    (0x1A00, 2, 0x60610008, 4),
    (0x1A00, 3, 0x60640020, 4),
    (0x1A00, 0, 0x03, 1),
    (0x1800, 1, 0x40000181, 4),
]
# Sevcon PDO Fundamentals rev 2, 3.1/3.2 and 4.1/4.2, put into CiA 301's order.
SEVCON_TPDO1: list[Write] = [
    (0x1800, 1, 0x80000181, 4),
    (0x1800, 2, 1, 1),
    (0x1800, 3, 0, 2),
    (0x1800, 5, 0, 2),
    (0x1A00, 0, 0, 1),
    (0x1A00, 1, 0x6C010110, 4),
    (0x1A00, 2, 0x606C0020, 4),
    (0x1A00, 3, 0x60410010, 4),
    (0x1A00, 0, 3, 1),
    (0x1800, 1, 0x00000201, 4),
]
ESPAC_RPDO1: list[Write] = [
    (0x1400, 2, 0xFF, 1),
    (0x1600, 0, 0, 1),
    (0x1600, 1, 0x00030010, 4),
    (0x1600, 2, 0x20200420, 4),
    (0x1600, 3, 0x20200210, 4),
    (0x1600, 0, 3, 1),
    (0x1400, 1, 0x00000201, 4),
]
# Sevcon PDO Fundamentals rev 2, 2.2.
VPDO: list[Write] = [
    (0x3000, 0, 0x01, 1),
    (0x3000, 1, 0x2020, 2),
    (0x3100, 0, 0x00, 1),
    (0x3200, 0, 0x01, 1),
    (0x3200, 1, 0x2400, 2),
    (0x3300, 0, 0x04, 1),
    (0x3300, 1, 0x2121, 2),
    (0x3300, 2, 0x2122, 2),
    (0x3300, 3, 0x2123, 2),
    (0x3300, 4, 0x2124, 2),
    (0x3400, 0, 0x01, 1),
    (0x3400, 1, 0x2220, 2),
]
# RoboteQ CAN Networking Manual, PDO mapping, in its order; bit 30 of the TPDO stays set.
ROBOTEQ_TPDO1: list[Write] = [
    (0x1800, 1, 0xC0000181, 4),
    (0x1A00, 0, 0, 1),
    (0x1A00, 1, 0x21000110, 4),
    (0x1A00, 2, 0x21000210, 4),
    (0x1A00, 3, 0x210D0110, 4),
    (0x1A00, 4, 0x210F0108, 4),
    (0x1A00, 0, 4, 1),
    (0x1800, 2, 1, 1),
    (0x1800, 1, 0x40000181, 4),
]
# ByteMe, PDO - Process Data Objects: node 5's TPDO1 keeps 0x185, node 6's RPDO1 follows.
LINK_TPDO1: list[Write] = [
    (0x1800, 1, 0xC0000185, 4),
    (0x1800, 2, 1, 1),
    (0x1A00, 0, 0, 1),
    (0x1A00, 1, 0x64010110, 4),
    (0x1A00, 2, 0x64010210, 4),
    (0x1A00, 3, 0x60000108, 4),
    (0x1A00, 0, 3, 1),
    (0x1800, 1, 0x40000185, 4),
]
LINK_RPDO1: list[Write] = [
    (0x1400, 1, 0x80000206, 4),
    (0x1600, 0, 0, 1),
    (0x1600, 1, 0x30000110, 4),
    (0x1600, 2, 0x30000210, 4),
    (0x1600, 3, 0x30010108, 4),
    (0x1600, 0, 3, 1),
    (0x1400, 1, 0x00000185, 4),
]
CASES = [
    pytest.param("tmcm", 1, TMCM_RPDO3, id="tmcm-rpdo3"),
    pytest.param("tmcm", 1, TMCM_TPDO1, id="tmcm-tpdo1"),
    pytest.param("gen4", 1, SEVCON_TPDO1, id="gen4-tpdo1"),
    pytest.param("espac", 1, SEVCON_TPDO1, id="espac-tpdo1"),
    pytest.param("espac", 1, ESPAC_RPDO1, id="espac-rpdo1"),
    pytest.param("roboteq", 1, ROBOTEQ_TPDO1, id="roboteq-tpdo1"),
    pytest.param("generic", 5, LINK_TPDO1, id="link-tpdo1"),
    pytest.param("generic", 6, LINK_RPDO1, id="link-rpdo1"),
]
VPDO_CASES = [pytest.param("gen4", 1, VPDO, id="gen4-vpdo"), pytest.param("espac", 1, VPDO, id="espac-vpdo")]


def run(client: Client, writes: list[Write]) -> None:
    for write in writes:
        client.write(*write)


@pytest.mark.parametrize(("family", "node_id", "writes"), [*CASES, *VPDO_CASES])
def test_worked_example_is_accepted_and_reads_back(family: str, node_id: int, writes: list[Write]) -> None:
    client = Client.on(booted(family, node_id))
    run(client, writes)
    for place, value in {(index, sub): value for index, sub, value, _ in writes}.items():
        assert client.number(*place) == value


@pytest.mark.parametrize(("family", "node_id", "writes"), CASES)
def test_mapping_while_the_pdo_is_valid_is_refused(family: str, node_id: int, writes: list[Write]) -> None:
    client = Client.on(booted(family, node_id))
    run(client, writes)  # now the PDO is valid
    with pytest.raises(Aborted) as caught:
        run(client, [each for each in writes if each[0] >> 8 in (0x16, 0x1A)])
    assert caught.value.code == 0x06010000


@pytest.mark.parametrize(
    ("family", "entry", "code"),
    [
        ("gen4", 0x00030010, 0x06040041),
        ("espac", 0x00060010, 0x06040041),
        ("tmcm", 0x00060010, 0x06040041),
        ("tmcm", 0x60410010, 0x06040041),
    ],
)
def test_dummies_and_directions_differ_by_family(family: str, entry: int, code: int) -> None:
    client = Client.on(booted(family))
    raw = client.number(0x1402, 1)
    run(client, [(0x1402, 1, raw | 1 << 31, 4), (0x1602, 0, 0, 1)])
    with pytest.raises(Aborted) as caught:
        client.write(0x1602, 1, entry, 4)
    assert caught.value.code == code


@pytest.mark.parametrize("entry", [0x00010001, 0x00050008, 0x00060010, 0x00070020])
def test_gen4_takes_its_own_dummies(entry: int) -> None:
    client = Client.on(booted("gen4"))
    run(client, [(0x1602, 0, 0, 1), (0x1602, 1, entry, 4), (0x1602, 0, 1, 1)])


@pytest.mark.parametrize("entry", [0x00010001, 0x00020008, 0x00030010, 0x00040020])
def test_espac_takes_the_dummies_of_the_note(entry: int) -> None:
    client = Client.on(booted("espac"))
    run(client, [(0x1608, 0, 0, 1), (0x1608, 1, entry, 4), (0x1608, 0, 1, 1)])


def test_read_write_words_feed_a_tpdo_on_gen4_only() -> None:
    gen4, tmcm = Client.on(booted("gen4")), Client.on(booted("tmcm"))
    run(gen4, [(0x1A02, 1, 0x21210001, 4), (0x1A02, 2, 0x60800020, 4)])
    run(tmcm, [(0x1801, 1, 0xC0000281, 4), (0x1A01, 0, 0, 1)])
    with pytest.raises(Aborted, match="06040041"):
        tmcm.write(0x1A01, 1, 0x27050008, 4)
    run(tmcm, [(0x1401, 1, 0xC0000301, 4), (0x1601, 0, 0, 1), (0x1601, 1, 0x27050008, 4)])


def test_byte_wise_families_refuse_single_bits() -> None:
    client = Client.on(booted("tmcm"))
    run(client, [(0x1401, 1, 0xC0000301, 4), (0x1601, 0, 0, 1)])
    with pytest.raises(Aborted, match="06040041"):
        client.write(0x1601, 1, 0x27030104, 4)


def test_three_entries_on_most_pdos_and_four_on_some() -> None:
    client = Client.on(booted("tmcm"))
    run(client, [(0x1800, 1, 0xC0000181, 4), (0x1A00, 0, 0, 1), (0x1803, 1, 0xC0000481, 4), (0x1A03, 0, 0, 1)])
    with pytest.raises(Aborted, match="06090011"):
        client.write(0x1A00, 4, 0x60410010, 4)
    client.write(0x1A03, 4, 0x60410010, 4)


def test_frame_of_the_trinamic_rpdo_lands_in_its_objects() -> None:
    device = booted("tmcm")
    run(Client.on(device), TMCM_RPDO3)
    device.state = NmtState.OPERATIONAL
    assert device.services.receive(Frame(0x401, bytes.fromhex("20A107000000FF00"))) == []
    assert int.from_bytes(device.value(0x607A), "little") == 500000
    assert int.from_bytes(device.value(0x2703, 1), "little") == 0x00FF0000


@pytest.mark.parametrize(
    ("family", "node_id", "writes", "can_id", "data"),
    [
        ("gen4", 1, SEVCON_TPDO1, 0x201, "000A24FAFFFF5002"),
        ("roboteq", 1, ROBOTEQ_TPDO1, 0x181, "7D00B0FF870022"),
        ("generic", 5, LINK_TPDO1, 0x185, "000A00FE05"),
        ("tmcm", 1, [(0x1800, 2, 1, 1), *TMCM_TPDO1], 0x181, "50020340E20100"),
    ],
)
def test_sync_frame_carries_the_mapped_values(
    family: str, node_id: int, writes: list[Write], can_id: int, data: str
) -> None:
    device = booted(family, node_id)
    run(Client.on(device), writes)
    device.state = NmtState.OPERATIONAL
    assert Frame(can_id, bytes.fromhex(data)) in device.services.sync()


def test_link_example_end_to_end() -> None:
    producer, consumer = booted("generic", 5), booted("generic", 6)
    run(Client.on(producer), LINK_TPDO1)
    run(Client.on(consumer), LINK_RPDO1)
    producer.state = consumer.state = NmtState.OPERATIONAL
    for frame in producer.services.sync():
        assert consumer.services.receive(frame) == []
    assert consumer.value(0x3000, 1) == producer.value(0x6401, 1)
    assert consumer.value(0x3000, 2) == producer.value(0x6401, 2)
    assert consumer.value(0x3001, 1) == producer.value(0x6000, 1)

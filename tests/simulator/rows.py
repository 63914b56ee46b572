"""What the strict device answers, as a literal table: row, preparation, request, answer.

The data of two drivers: in-process (`test_table`) and over a link (`tests/simulator/serve/test_conformance`).
"""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from dvtcli.domain.nmt import NmtCommand, NmtState
from tests.simulator.bench import Aborted, Bench, Client

Write = tuple[int, int, int, int]
OK = 0
SAVE, LOAD = 0x65766173, 0x64616F6C

# The generic family's TPDO1 (0x1800/0x1A00) is valid, its TPDO3 (0x1802/0x1A02) and RPDO3 (0x1402/0x1602) are not;
# all three have a mapping.
OPEN_T3: tuple[Write, ...] = ((0x1A02, 0, 0, 1),)
OPEN_R3: tuple[Write, ...] = ((0x1602, 0, 0, 1),)


def entries(index: int, *raw: int) -> tuple[Write, ...]:
    return ((index, 0, 0, 1), *((index, sub, value, 4) for sub, value in enumerate(raw, 1)))


@dataclass(frozen=True)
class Row:
    row: str
    write: Write
    answer: int
    before: tuple[Write, ...] = ()
    family: str = "generic"
    state: NmtState = NmtState.PRE_OPERATIONAL
    keeps: int | None = None  # what the object holds afterwards, where that is part of the row

    def __str__(self) -> str:
        index, sub_index, value, size = self.write
        return f"{self.row}-{self.family}-{index:04X}:{sub_index:02X}={value:0{2 * size}X}"


ROWS = [
    Row("A1", (0x5FFF, 0, 0, 1), 0x06020000),
    Row("A1", (0x1A04, 1, 0, 4), 0x06020000),
    Row("A2", (0x1018, 9, 0, 4), 0x06090011),
    Row("A2", (0x1800, 4, 0, 1), 0x06090011),
    Row("A3", (0x1000, 0, 0, 4), 0x06010002),
    Row("A3", (0x1018, 1, 0, 4), 0x06010002),
    Row("A3", (0x1800, 0, 0, 1), 0x06010002),
    Row("A4", (0x1A02, 0, 0, 4), 0x06070012),
    Row("A4", (0x6040, 0, 0, 3), 0x06070012),
    Row("A4", (0x1A02, 1, 0, 2), 0x06070013),
    Row("A4", (0x6040, 0, 0, 1), 0x06070013),
    Row("A5", (0x2003, 0, 1001, 2), 0x06090031),
    Row("A5", (0x2003, 0, 1000, 2), OK),
    Row("A5", (0x6060, 0, 11, 1), 0x06090031),
    Row("A5", (0x1003, 0, 1, 1), 0x06090031),
    Row("A5", (0x1801, 5, 0x8000, 2), 0x06090031, family="gen4"),
    Row("A5", (0x3300, 1, 0x20FF, 2), 0x06090032, family="gen4"),
    Row("B1", (0x1A00, 1, 0x60640020, 4), 0x06010000, keeps=0x60410010),
    Row("B1", (0x1A00, 1, 0x60410010, 4), 0x06010000),
    Row("B1", (0x1A02, 1, 0x60640020, 4), 0x06010000, keeps=0x60410010),
    Row("B2", (0x1A00, 0, 0, 1), 0x06010000, keeps=1),
    Row("B2", (0x1A00, 0, 1, 1), 0x06010000),
    Row("B2", (0x1600, 0, 9, 1), 0x06010000),
    Row("B3", (0x1A02, 1, 0x5FFF0010, 4), 0x06020000, OPEN_T3, keeps=0x60410010),
    Row("B3", (0x1A02, 1, 0x6401FF10, 4), 0x06090011, OPEN_T3, keeps=0x60410010),
    Row("B3", (0x1A02, 1, 0x60410110, 4), 0x06090011, OPEN_T3),
    Row("B4", (0x1A02, 1, 0x20030010, 4), 0x06040041, OPEN_T3, keeps=0x60410010),
    Row("B4", (0x1A02, 1, 0x10080020, 4), 0x06040041, OPEN_T3),
    Row("B4", (0x1A02, 1, 0x60400010, 4), 0x06040041, OPEN_T3),
    Row("B4", (0x1602, 1, 0x60410010, 4), 0x06040041, OPEN_R3),
    Row("B4", (0x1A02, 1, 0x00050008, 4), 0x06040041, OPEN_T3),
    Row("B4", (0x1602, 1, 0x00010001, 4), 0x06040041, OPEN_R3),
    Row("B4", (0x1602, 1, 0x00050008, 4), OK, OPEN_R3),
    Row("B4", (0x1A02, 1, 0x20000020, 4), OK, OPEN_T3),
    Row("B4", (0x1602, 1, 0x20000020, 4), OK, OPEN_R3),
    Row("B5", (0x1A02, 1, 0x60410020, 4), 0x06040041, OPEN_T3, keeps=0x60410010),
    Row("B5", (0x1A02, 1, 0x60000104, 4), 0x06040041, OPEN_T3),
    Row("B5", (0x1602, 1, 0x00050010, 4), 0x06040041, OPEN_R3),
    Row("B6", (0x1A02, 1, 0x60640008, 4), OK, OPEN_T3, keeps=0x60640008),
    Row("B7", (0x1A02, 1, 0, 4), OK, OPEN_T3, keeps=0),
    Row("B7", (0x1A02, 0, 1, 1), 0x06040041, entries(0x1A02, 0), keeps=0),
    Row("B8", (0x1A02, 0, 9, 1), 0x06040042, OPEN_T3, keeps=0),
    Row("B8", (0x1A02, 0, 0xFF, 1), 0x06040042, OPEN_T3),
    Row("B8", (0x1A02, 0, 3, 1), 0x06040042, entries(0x1A02, 0x60640020, 0x606C0020, 0x60000108), keeps=0),
    Row("B8", (0x1A02, 0, 2, 1), OK, entries(0x1A02, 0x60640020, 0x606C0020, 0x60000108), keeps=2),
    Row("B9", (0x1A02, 0, 1, 1), 0x06090030, entries(0x1A02, 0x60640000), keeps=0),
    Row("B10", (0x1A02, 9, 0x60640020, 4), 0x06090011, OPEN_T3),
    Row("B11", (0x1A02, 1, 0x60410020, 4), 0x06040041, OPEN_T3, keeps=0x60410010),
    Row("B11", (0x1A02, 0, 9, 1), 0x06040042, keeps=2),
    Row("C1", (0x1800, 1, 0x40000182, 4), 0x06090030, keeps=0x40000181),
    Row("C1", (0x1800, 1, 0x60000181, 4), 0x06090030),
    Row("C2", (0x1800, 1, 0x40000181, 4), OK, keeps=0x40000181),
    Row("C3", (0x1800, 1, 0xC0000181, 4), OK, keeps=0xC0000181),
    Row("C3", (0x1800, 1, 0xC00003A0, 4), OK),
    Row("C3", (0x1800, 1, 0x80000000, 4), OK),
    Row("C3", (0x1802, 1, 0xC0000601, 4), OK),
    *(
        Row("C4", (0x1802, 1, 0x40000000 | can_id, 4), 0x06090030, keeps=0xC0000381)
        for can_id in (0x000, 0x001, 0x07F, 0x101, 0x180, 0x581, 0x5FF, 0x601, 0x67F, 0x6E0, 0x6FF, 0x701, 0x780, 0x7FF)
    ),
    *(
        Row("C4", (0x1802, 1, 0x40000000 | can_id, 4), OK)
        for can_id in (0x080, 0x081, 0x100, 0x181, 0x580, 0x600, 0x680, 0x6DF, 0x700)
    ),
    Row("C4", (0x1802, 1, 0x00000800, 4), 0x06090030),
    Row("C5", (0x1802, 1, 0x40000381, 4), 0x06090030, OPEN_T3, keeps=0xC0000381),
    Row("C6", (0x1801, 1, 0xA0000281, 4), 0x06090030, family="gen4"),
    Row("C6", (0x1800, 1, 0xE0000181, 4), 0x06090030, family="tmcm"),
    Row("C6", (0x1802, 1, 0x60012345, 4), OK),
    Row("C7", (0x1800, 1, 0xC0000181, 4), 0x06090030, family="gen4", keeps=0x181),
    Row("C7", (0x1800, 1, 0x80000181, 4), 0x06090030, family="tmcm", keeps=0x40000181),
    Row("C7", (0x1402, 1, 0x80000401, 4), 0x06090030, family="tmcm", keeps=0x40000401),
    Row("C7", (0x1800, 1, 0x80000181, 4), 0x06090030, family="roboteq", keeps=0x40000181),
    Row("C7", (0x1402, 1, 0x80000401, 4), OK, family="roboteq"),
    Row("C7", (0x1402, 1, 0xC0000401, 4), OK, family="roboteq"),
    Row("C8", (0x1802, 1, 0x40000281, 4), OK),
    *(Row("D1", (0x1802, 2, value, 1), 0x06090030, keeps=1) for value in (241, 251, 252, 253)),
    *(Row("D1", (0x1402, 2, value, 1), 0x06090030, keeps=255) for value in (241, 251, 252, 253)),
    *(Row("D1", (0x1802, 2, value, 1), OK, ((0x1802, 1, 0x80000381, 4),)) for value in (252, 253)),
    *(Row("D1", (0x1802, 2, value, 1), OK) for value in (0, 1, 240, 254, 255)),
    *(Row("D1", (0x1402, 2, value, 1), OK) for value in (0, 1, 240, 254, 255)),
    Row("D1", (0x1800, 2, 0, 1), 0x06090030, family="tmcm"),
    Row("D1", (0x1800, 2, 241, 1), 0x06090030, family="gen4"),
    Row("D2", (0x1800, 2, 1, 1), OK, keeps=1),
    Row("D2", (0x1800, 5, 50, 2), OK, keeps=50),
    Row("D3", (0x1800, 3, 100, 2), 0x06090030, keeps=0),
    Row("D3", (0x1800, 6, 1, 1), 0x06090030, keeps=0),
    Row("D3", (0x1802, 3, 100, 2), OK, keeps=100),
    Row("D3", (0x1802, 6, 1, 1), OK, keeps=1),
    *(Row("E1", (0x1010, sub, LOAD, 4), 0x08000020) for sub in (1, 2, 3)),
    *(Row("E1", (0x1011, sub, SAVE, 4), 0x08000020) for sub in (1, 2, 3)),
    Row("E1", (0x1010, 1, 1, 4), 0x08000000, family="gen4"),
    Row("E2", (0x1010, 1, SAVE, 4), 0x08000000, family="gen4", state=NmtState.OPERATIONAL),
    Row("E2", (0x1010, 1, SAVE, 4), OK, family="gen4"),
    Row("E2", (0x1010, 1, SAVE, 4), OK, state=NmtState.OPERATIONAL),
    *(Row("E4", (0x1010, sub, SAVE, 4), OK, keeps=1) for sub in (1, 2, 3)),
    *(Row("E4", (0x1011, sub, LOAD, 4), OK, keeps=1) for sub in (1, 2, 3)),
    Row("F1", (0x1019, 0, 10, 1), 0x08000022, ((0x1006, 0, 20000, 4),), keeps=0),
    Row("F1", (0x1019, 0, 0, 1), OK, ((0x1006, 0, 20000, 4),)),
    Row("F1", (0x1019, 0, 10, 1), OK, keeps=10),
]
#: row, index, sub-index, answer of an upload
UPLOADS = [
    ("A1", 0x5FFF, 0, 0x06020000),
    ("A2", 0x1800, 4, 0x06090011),
    ("A2", 0x6041, 5, 0x06090011),
    ("A2", 0x1A00, 9, 0x06090011),
    ("A3", 0x2004, 0, 0x06010001),
]
#: A6: command specifiers that do not exist, segments of no transfer, segments with the wrong toggle bit
SPECIFIERS = [0xA1, 0xC1, 0xE0, 0xFF]
SEGMENTS = [0x00, 0x60]
TOGGLES = [("40081000", "70"), ("2102200006000000", "10414243444546")]
#: A7: requests that get no answer while the node is STOPPED
UNANSWERED = ["4000180100000000", "2300180181010040", "60", "A0001801"]


def check_download(bench: Bench, row: Row, *, segmented: bool) -> None:
    """Do what *row* says on a node as it left the factory."""
    client = bench.client
    for each in row.before:
        client.write(*each)
    if row.state is NmtState.OPERATIONAL:
        bench.nmt(NmtCommand.START)
    index, sub_index, value, size = row.write
    data = value.to_bytes(size, "little")
    send = client.write_segmented if segmented else client.write_bytes
    answer = OK
    try:
        send(index, sub_index, data)
    except Aborted as abort:
        answer = abort.code
    assert f"{answer:08X}" == f"{row.answer:08X}"
    if row.keeps is not None:
        assert client.number(index, sub_index) == row.keeps


def check_upload(client: Client, index: int, sub_index: int, answer: int) -> None:
    """An upload that is refused."""
    with pytest.raises(Aborted) as caught:
        client.read(index, sub_index)
    assert caught.value.code == answer


def check_specifier(client: Client, specifier: int) -> None:
    """A command specifier that does not exist, with its multiplexer in the answer."""
    assert client.server.handle(bytes([specifier, 0x00, 0x18, 1, 0, 0, 0, 0])) == bytes.fromhex("80001801 01000405")


def check_segment(client: Client, segment: int) -> None:
    """A segment of no transfer."""
    with pytest.raises(Aborted) as caught:
        client.ask(bytes([segment]))
    assert caught.value.code == 0x05040001


def check_toggle(client: Client, start: str, segment: str) -> None:
    """A first segment whose toggle bit is set."""
    client.ask(bytes.fromhex(start))
    with pytest.raises(Aborted) as caught:
        client.ask(bytes.fromhex(segment))
    assert caught.value.code == 0x05030000


def check_silence(client: Client, request: str) -> None:
    """No answer at all."""
    assert client.server.handle(bytes.fromhex(request).ljust(8, b"\0")) is None

"""Reading a PDO and finding PDOs: at the edges of what a device may answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.node import Node
from dvtcli.device.read_pdos import (
    WHATEVER,
    exists,
    learnt_objects,
    present_pdos,
    read_identity,
    read_number,
    read_optional,
    read_pdo,
    service_ids,
)
from dvtcli.device.read_whole import Unread, read_whole, scan_objects, values_of
from dvtcli.device.target_config import differences
from dvtcli.domain.configuration import Configuration
from dvtcli.domain.datatypes import U32
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry, OdObject
from dvtcli.domain.pdo import Pdo, PdoMappingEntry
from dvtcli.domain.profile import GENERIC
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError
from tests.device.test_reading_and_storing import Table
from tests.laws.bench import NODE, DirectBus, booted, silence

TPDO1, RPDO1 = Pdo.parse("tpdo1"), Pdo.parse("rpdo1")


class Refusing(Table):
    """A device that refuses every question with *code*."""

    code = 0

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        raise SdoAborted(index, sub_index, self.code)


@pytest.mark.parametrize(
    ("answer", "value"), [(b"\1", 1), (b"\1\2", 0x201), (b"\1\2\0\0", 0x201), (b"", None), (b"\1\2\0\1", None)]
)
def test_a_number_may_be_padded_and_not_be_larger(answer: bytes, value: int | None) -> None:
    table = Table({(0x1017, 0): answer})
    if value is not None:
        assert read_number(table, 0x1017, 0, 2) == value
        return
    with pytest.raises(SdoProtocolError, match=f"0x1017:00 answered {len(answer)} bytes") as caught:
        read_number(table, 0x1017, 0, 2)
    assert caught.value.place == "1017:00"


@pytest.mark.parametrize("code", [0x0602_0000, 0x0609_0011])
def test_what_is_absent_is_none(code: int) -> None:
    device = Refusing({})
    device.code = code
    assert read_optional(device, 0x1018, 4, 4) is None
    assert not exists(device, TPDO1)


def test_another_refusal_is_not_absence() -> None:
    device = Refusing({})
    device.code = 0x0800_0000
    with pytest.raises(SdoAborted):
        read_optional(device, 0x1018, 4, 4)
    assert read_identity(device, 4) is None


def pdo_of(count: int, index: int = 0x1A00) -> Table:
    entries = {(index, number): (0x6041_0000 + number).to_bytes(4, "little") for number in range(1, 65)}
    comm = index - 0x200
    rows = {(comm, 1): b"\x81\1\0\0", (comm, 2): b"\xff", (comm, 3): b"\3\0", (comm, 5): b"\5\0", (comm, 6): b"\6"}
    return Table({**rows, (index, 0): bytes([count]), **entries})


def test_every_parameter_comes_from_its_own_sub_index() -> None:
    tpdo, rpdo = read_pdo(pdo_of(0), TPDO1).communication, read_pdo(pdo_of(0, 0x1600), RPDO1).communication
    for parameter in (tpdo, rpdo):
        assert parameter.cob_id.raw == 0x181
        assert (parameter.transmission_type, parameter.inhibit_time, parameter.event_timer) == (0xFF, 3, 5)
    assert (tpdo.sync_start_value, rpdo.sync_start_value) == (6, None)


@pytest.mark.parametrize("count", [0, 1, 2, 64])
def test_as_many_entries_as_the_count_says(count: int) -> None:
    assert [entry.bits for entry in read_pdo(pdo_of(count), TPDO1).mapping] == list(range(1, count + 1))


@pytest.mark.parametrize("count", [65, 0xFD])
def test_a_count_that_no_pdo_has(count: int) -> None:
    config = read_pdo(pdo_of(count), TPDO1)
    assert (config.count, len(config.mapping), config.unread) == (count, 64, ())
    assert config.inconsistency == f"its count is {count}, a PDO has 0..64 entries"


@pytest.mark.parametrize("count", [0xFE, 0xFF])
def test_a_multiplexed_pdo_says_so(count: int) -> None:
    config = read_pdo(pdo_of(count), TPDO1)
    assert (config.mpdo, config.mapping) == (count, ())


def having(*places: int) -> Table:
    return Table({(index, 1): b"\1\0\0\0" for index in places})


def test_without_a_file_the_first_four_are_asked_for_and_then_up_to_a_gap() -> None:
    table = having(0x1800, 0x1803, 0x1804, 0x1805, 0x1807, 0x1401)
    assert [str(pdo) for pdo in present_pdos(table, None)] == ["tpdo1", "tpdo4", "tpdo5", "tpdo6", "rpdo2"]
    cob_ids = [index for index, _ in table.reads if index & 0x200 == 0]
    assert cob_ids == [*range(0x1800, 0x1807), *range(0x1400, 0x1405)]
    mappings = [index for index, _ in table.reads if index & 0x200]
    assert mappings == [0x1A01, 0x1A02, 0x1A06, 0x1600, 0x1602, 0x1603, 0x1604], "where there is no COB-ID"


def test_all_512_are_found() -> None:
    table = having(*range(0x1800, 0x1A00))
    assert len(present_pdos(table, None)) == 512


def test_with_a_file_half_pdos_count_too_tpdos_first() -> None:
    indices = (0x1400, 0x1600, 0x1401, 0x1A01, 0x1801, 0x1800, 0x1A00, 0x1A02)
    objects = {index: OdObject(index, "", 9, {0: OdEntry(index, 0, "")}) for index in indices}
    assert [str(pdo) for pdo in present_pdos(Table({}), ObjectDictionary(objects))] == [
        "tpdo1", "tpdo2", "tpdo3", "rpdo1", "rpdo2",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("sub_index", "size", "field"),
    [(2, 1, "transmission_type"), (3, 2, "inhibit_time"), (5, 2, "event_timer"), (6, 1, "sync_start_value")],
)
def test_every_parameter_has_its_own_length_and_no_more(sub_index: int, size: int, field: str) -> None:
    table = pdo_of(0)
    table.values[0x1800, sub_index] = b"\xfe" * size
    assert getattr(read_pdo(table, TPDO1).communication, field) == (0xFE if size == 1 else 0xFEFE)
    table.values[0x1800, sub_index] = b"\1" * (size + 1)
    with pytest.raises(SdoProtocolError, match=f"0x1800:0{sub_index} answered {size + 1} bytes"):
        read_pdo(table, TPDO1)


TOO_LONG = b"\1\2\3\4\5"


@pytest.mark.parametrize(
    ("place", "read"),
    [
        ((0x1018, 4), lambda sdo: read_identity(sdo, 4)),
        ((0x1005, 0), lambda sdo: service_ids(sdo, 1, None)),
        ((0x1014, 0), lambda sdo: service_ids(sdo, 1, None)),
        ((0x1800, 1), lambda sdo: exists(sdo, TPDO1)),
        ((0x1A00, 0), lambda sdo: exists(sdo, TPDO1)),
    ],
)
def test_a_fifth_byte_is_never_dropped(place: tuple[int, int], read: Callable[[Table], object]) -> None:
    read(Table({place: TOO_LONG[:4]}))
    with pytest.raises(SdoProtocolError, match="answered 5 bytes"):
        read(Table({place: TOO_LONG}))


@pytest.mark.parametrize("place", [(0x1800, 1), (0x1A00, 0), (0x1A00, 1)])
def test_a_refusal_that_may_pass_does_not_make_a_pdo_inconsistent(place: tuple[int, int]) -> None:
    class Busy(Table):
        def upload(
            self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
        ) -> bytes:
            if (index, sub_index) == place:
                raise SdoAborted(index, sub_index, 0x0800_0022)
            return super().upload(index, sub_index)

    with pytest.raises(SdoAborted, match="0800"):
        read_pdo(Busy(pdo_of(1).values), TPDO1)


def test_lengths_are_learnt_of_objects_and_not_of_gaps() -> None:
    words = (0x6041_0010, 0x0005_0008, 0x2345_0120)
    asked: list[tuple[int, int]] = []

    def upload(index: int, sub_index: int) -> bytes:
        asked.append((index, sub_index))
        if index == 0x6041:
            return bytes(2)
        raise SdoAborted(index, sub_index, 0x0602_0000)

    lengths, absent = learnt_objects(map(PdoMappingEntry.from_raw, words), upload)
    assert (lengths, absent) == ({(0x6041, 0): 16}, {(0x2345, 1): 0x0602_0000})
    assert asked == [(0x6041, 0), (0x2345, 1)]


def test_an_entry_of_a_mapping_has_four_bytes() -> None:
    values = {(0x1800, 1): b"\x81\1\0\0", (0x1A00, 0): b"\1", (0x1A00, 1): b"\x10\0\x41\x60\1"}
    with pytest.raises(SdoProtocolError, match="0x1A00:01 answered 5 bytes"):
        read_pdo(Table(values), TPDO1)


@dataclass
class Choosy(Table):
    """A table that refuses what *refused* says, with its code."""

    refused: dict[tuple[int, int], int] = field(default_factory=dict)

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        if (index, sub_index) in self.refused:
            raise SdoAborted(index, sub_index, self.refused[index, sub_index])
        return super().upload(index, sub_index, timeout_s=timeout_s, retries=retries)


@pytest.mark.parametrize("sub_index", [2, 3, 5, 6])
@pytest.mark.parametrize("code", [0x0800_0022, 0x0800_0000, 0x0504_0000, 0x0609_0011, 0x0602_0000, 0x0601_0001])
def test_an_optional_parameter_that_is_refused_for_a_moment_is_not_one_that_is_not_there(
    sub_index: int, code: int
) -> None:
    device = Choosy(pdo_of(0).values, refused={(0x1800, sub_index): code})
    config, whole = read_pdo(device, TPDO1, WHATEVER), read_pdo(pdo_of(0), TPDO1)
    may_pass = code >> 24 != 6
    assert config.unread == (((0x1800, sub_index),) if may_pass else ())
    assert config != whole
    assert bool(config.inconsistency) is bool(config.untold) is may_pass
    assert (config.has_cob_id, config.has_mapping, config.enabled) == (True, True, True)
    assert any(f"0x1800:{sub_index:02X} cannot be read" in text for text in differences(TPDO1, whole, config)) is (
        may_pass
    )
    assert bool(differences(TPDO1, config, whole)) is not may_pass, "what could not be read wishes nothing"
    if may_pass:
        with pytest.raises(SdoAborted):
            read_pdo(device, TPDO1)


class SilentAboutGaps(Table):
    """A device that answers nothing about an object that it does not have."""

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        if (index, sub_index) not in self.values:
            self.reads.append((index, sub_index))
            raise silence(index, sub_index)
        return super().upload(index, sub_index)


@pytest.mark.parametrize(("there", "gaps"), [((), 1), ((0x2000,), 3), ((0x2000, 0x2002, 0x2004), 3)])
def test_a_device_that_is_silent_about_gaps_is_not_asked_for_all_of_them(there: tuple[int, ...], gaps: int) -> None:
    """Each costs a time-out, and 36,000 are asked for."""
    table = SilentAboutGaps({(index, 0): b"\0\0" for index in there})
    node = Node(DirectBus(booted(), table), NODE)
    with pytest.raises(NoAnswer) as caught:
        scan_objects(node, Configuration(GENERIC), (range(0x2000, 0x3000),))
    assert "does not report missing objects; reading it needs its EDS" in typed(caught.value.hint)
    assert len([place for place in table.reads if place not in table.values]) == gaps


def test_two_objects_about_which_a_device_is_silent_are_named_as_such() -> None:
    table = SilentAboutGaps({(index, 0): b"\0\0" for index in (0x2000, 0x2003)})
    node = Node(DirectBus(booted(), table), NODE)
    found = scan_objects(node, Configuration(GENERIC), (range(0x2000, 0x2004),))
    assert [place[0] for place, one in found.items() if one.unread is Unread.SILENT] == [0x2001, 0x2002]


def test_who_a_device_is_is_not_asked_twice_for_a_whole_reading() -> None:
    entries = [OdEntry(index, sub_index, "", U32) for index, sub_index in ((0x1000, 0), (0x1018, 1), (0x2000, 0))]
    table = Table({(entry.index, entry.sub_index): bytes(4) for entry in entries})
    node = Node(DirectBus(booted(), table), NODE)
    for place in ((0x1000, 0), (0x1018, 1)):
        node.read_cache.upload(*place)
    table.reads.clear()
    found = read_whole(node, entries, Configuration(GENERIC))
    assert (values_of(found), table.reads) == (table.values, [(0x2000, 0)])
    node.read_cache.clear()
    read_whole(node, entries, Configuration(GENERIC))
    assert table.reads == [(0x2000, 0), *table.values], "the node may have restarted"

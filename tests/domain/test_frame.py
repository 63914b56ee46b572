from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.datatypes import BY_SHORT_NAME, DataType, Kind, Value
from dvtcli.domain.frame import Field, byte_length, decode, encode, layout, pack, unpack, values_reader
from dvtcli.domain.pdo import DUMMY_BITS, PdoMappingEntry
from tests.domain.test_datatypes import values

FIXED = [data_type for data_type in BY_SHORT_NAME.values() if data_type.bits]
dummies = st.sampled_from([(PdoMappingEntry(index, 0, bits), None, 0) for index, bits in DUMMY_BITS.items()])


@st.composite
def mapped(draw: st.DrawFn) -> tuple[PdoMappingEntry, DataType | None, Value]:
    """An object mapped with all its bits, its type and a value; now and then of unknown type."""
    data_type = draw(st.sampled_from(FIXED))
    address = (draw(st.integers(0x2000, 0xFFFF)), draw(st.integers(0, 255)))
    assert data_type.bits is not None
    entry = PdoMappingEntry(*address, data_type.bits)
    if draw(st.integers(0, 5)) == 0:
        return entry, None, draw(st.integers(0, (1 << data_type.bits) - 1))
    return entry, data_type, draw(values(data_type))


rows = st.lists(st.one_of(mapped(), dummies), max_size=8, unique_by=lambda row: (row[0].index, row[0].sub_index))


def entry(text: str) -> PdoMappingEntry:
    place, bits = text.split("/")
    index, sub_index = place.split(":")
    return PdoMappingEntry(int(index, 16), int(sub_index, 16), int(bits))


def untyped(_: PdoMappingEntry) -> None:
    return None


@given(rows)
def test_values_survive_the_frame(items: list[tuple[PdoMappingEntry, DataType | None, Value]]) -> None:
    entries = [mapped_entry for mapped_entry, _, _ in items]
    types = {mapped_entry: data_type for mapped_entry, data_type, _ in items}
    wanted = {(e.index, e.sub_index): value for e, _, value in items if not e.is_dummy}
    data = encode(entries, wanted, types.get)
    assert len(data) == byte_length(sum(e.bits for e in entries))
    found = decode(entries, data, types.get)
    assert {(e.index, e.sub_index): value for e, _, value in found} == wanted
    assert [e for e, _, _ in found] == [e for e in entries if not e.is_dummy]


@given(st.lists(st.builds(PdoMappingEntry, st.just(0x2000), st.integers(0, 255), st.integers(0, 64))), st.binary())
def test_fields_lie_without_gaps_and_any_data_can_be_looked_at(entries: list[PdoMappingEntry], data: bytes) -> None:
    fields = layout(entries)
    assert [field.start_bit for field in fields] == [sum(e.bits for e in entries[:k]) for k in range(len(entries))]
    for field, (_, raw) in zip(fields, unpack(entries, data), strict=True):
        assert (raw is None) == (field.end_bit > 8 * len(data))


@given(st.integers(0, (1 << 64) - 1), st.lists(st.integers(1, 16), min_size=4, max_size=4))
def test_packing_what_was_unpacked_gives_the_same_bits(word: int, lengths: list[int]) -> None:
    entries = [PdoMappingEntry(0x2000, number, bits) for number, bits in enumerate(lengths)]
    data = (word & (1 << sum(lengths)) - 1).to_bytes(byte_length(sum(lengths)), "little")
    raws = {e: raw or 0 for e, raw in unpack(entries, data)}
    assert pack(entries, raws.__getitem__) == data


def test_the_note_s_frame() -> None:
    """Trinamic AN076, example 4.1: target position 500000, outputs 0x00FF0000."""
    entries = [entry("607A:0/32"), entry("2703:1/32")]
    types = {entries[0]: BY_SHORT_NAME["i32"], entries[1]: BY_SHORT_NAME["u32"]}
    data = bytes.fromhex("20 A1 07 00 00 00 FF 00")
    assert encode(entries, {(0x607A, 0): 500000, (0x2703, 1): 0x00FF_0000}, types.get) == data
    assert [value for _, _, value in decode(entries, data, types.get)] == [500000, 0x00FF_0000]


def test_signed_value_at_an_odd_bit() -> None:
    """One switch, two skipped bits, then -1500 as 16 bits from bit 3 to bit 18."""
    entries = [entry("2121:0/1"), entry("1:0/1"), entry("1:0/1"), entry("6077:0/16")]
    types = {entries[0]: BY_SHORT_NAME["bool"], entries[3]: BY_SHORT_NAME["i16"]}
    data = encode(entries, {(0x2121, 0): True, (0x6077, 0): -1500}, types.get)
    assert data == ((0xFA24 << 3) | 1).to_bytes(3, "little")
    assert [(raw, value) for _, raw, value in decode(entries, data, types.get)] == [(1, True), (0xFA24, -1500)]


def test_a_short_frame_lacks_its_last_objects() -> None:
    entries = [entry("6041:0/16"), entry("6064:0/32")]
    assert [value for _, _, value in decode(entries, bytes.fromhex("371210"), untyped)] == [0x1237, None]
    assert [value for _, _, value in decode(entries, b"", untyped)] == [None, None]


def test_a_part_of_an_object() -> None:
    part = entry("6064:0/16")
    assert decode([part], b"\xff\xff", lambda _: BY_SHORT_NAME["i32"])[0].value == -1
    assert decode([part], b"\xff\xff", lambda _: BY_SHORT_NAME["r32"])[0].value == 0xFFFF
    assert encode([part], {(0x6064, 0): -1}, lambda _: BY_SHORT_NAME["i32"]) == b"\xff\xff"


@pytest.mark.parametrize(
    ("text", "short", "value", "words"),
    [
        ("6041:0/16", "u16", None, "no value for 6041:00"),
        ("6041:0/16", "u16", 65536, "does not fit UNSIGNED16"),
        ("6064:0/16", "i32", 40000, "does not fit the 16 bits"),
        ("6064:0/32", "i32", 1.5, "is not a number"),
        ("6064:0/16", "r32", 1.5, "takes 32 bits"),
        ("2000:0/16", "vs", "abc", "takes 24 bits"),
        ("2000:0/0", "u8", 1, "does not fit the 0 bits"),
    ],
)
def test_values_that_do_not_fit(text: str, short: str, value: Value | None, words: str) -> None:
    wanted = entry(text)
    given_values = {} if value is None else {(wanted.index, wanted.sub_index): value}
    with pytest.raises(ValueError, match=words):
        encode([wanted], given_values, lambda _: BY_SHORT_NAME[short])


def test_texts_fill_their_bytes() -> None:
    wanted = entry("2000:0/32")
    data = encode([wanted], {(0x2000, 0): "abc"}, lambda _: BY_SHORT_NAME["vs"])
    assert data == b"abc\0"
    assert decode([wanted], data, lambda _: BY_SHORT_NAME["vs"])[0].value == "abc"
    assert BY_SHORT_NAME["vs"].kind is Kind.VISIBLE_STRING


@pytest.mark.parametrize(
    ("start", "bits", "touched"),
    [
        (0, 16, [0, 1]),
        (16, 32, [2, 3, 4, 5]),
        (1, 1, [0]),
        (3, 16, [0, 1, 2]),
        (4, 4, [0]),
    ],
)
def test_bytes_of_a_field(start: int, bits: int, touched: list[int]) -> None:
    field = Field(start, bits, PdoMappingEntry(0x2000, 0, bits))
    assert list(field.bytes) == touched


@given(rows, st.binary(max_size=10))
def test_any_data_is_read_as_each_object_s_own_type_reads_its_bits(
    mapped_rows: list[tuple[PdoMappingEntry, DataType | None, Value]], data: bytes
) -> None:
    entries = [row[0] for row in mapped_rows]
    types = {row[0]: row[1] for row in mapped_rows}

    def value(entry: PdoMappingEntry, raw: int | None) -> Value | None:
        data_type = types[entry]
        if raw is None or data_type is None:
            return raw
        return data_type.decode(raw.to_bytes((entry.bits + 7) // 8, "little"))

    expected = [value(entry, raw) for entry, raw in unpack(entries, data)]
    assert repr(values_reader(entries, types.get)(data)) == repr(expected)  # NaN equals nothing
    assert repr([row.value for row in decode(entries, data, types.get)]) == repr(expected)

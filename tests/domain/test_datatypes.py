from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.datatypes import BY_SHORT_NAME, DATA_TYPES, CanopenTime, DataType, Kind, Value, parse_number

#: CiA 301, data type entry specification: code, name, length in bits.
STANDARD = """
01 BOOLEAN 1           02 INTEGER8 8         03 INTEGER16 16      04 INTEGER32 32      05 UNSIGNED8 8
06 UNSIGNED16 16       07 UNSIGNED32 32      08 REAL32 32         09 VISIBLE_STRING -  0A OCTET_STRING -
0B UNICODE_STRING -    0C TIME_OF_DAY 48     0D TIME_DIFFERENCE 48  0F DOMAIN -
10 INTEGER24 24        11 REAL64 64          12 INTEGER40 40      13 INTEGER48 48      14 INTEGER56 56
15 INTEGER64 64        16 UNSIGNED24 24      18 UNSIGNED40 40     19 UNSIGNED48 48     1A UNSIGNED56 56
1B UNSIGNED64 64
"""
types = st.sampled_from(list(DATA_TYPES.values()))
integer_types = st.sampled_from([data_type for data_type in DATA_TYPES.values() if data_type.limits])


def values(data_type: DataType) -> st.SearchStrategy[Value]:
    """Every value that *data_type* can carry unchanged."""
    if data_type.limits:
        return st.booleans() if data_type.kind is Kind.BOOLEAN else st.integers(*data_type.limits)
    by_kind: dict[Kind, st.SearchStrategy[Value]] = {
        Kind.REAL: st.floats(width=32 if data_type.bits == 32 else 64, allow_nan=False),
        Kind.TIME: st.builds(CanopenTime, st.integers(0, (1 << 28) - 1), st.integers(0, 0xFFFF)),
        Kind.OCTETS: st.binary(max_size=40),
        Kind.VISIBLE_STRING: st.text(st.characters(max_codepoint=255)).map(lambda text: text.rstrip("\0")),
        Kind.UNICODE_STRING: st.text(st.characters(codec="utf-16-le")).map(lambda text: text.rstrip("\0")),
    }
    return by_kind[data_type.kind]


typed_values = types.flatmap(lambda data_type: st.tuples(st.just(data_type), values(data_type)))


def test_codes_names_and_lengths_are_the_standards() -> None:
    rows = re.findall(r"([0-9A-F]{2}) (\w+) (\d+|-)", STANDARD)
    assert {int(code, 16): (name, None if bits == "-" else int(bits)) for code, name, bits in rows} == {
        data_type.code: (data_type.name, data_type.bits) for data_type in DATA_TYPES.values()
    }
    assert len(BY_SHORT_NAME) == len(DATA_TYPES)


@given(typed_values)
def test_values_survive_the_wire(pair: tuple[DataType, Value]) -> None:
    data_type, value = pair
    data = data_type.encode(value)
    assert data_type.decode(data) == value
    assert data_type.size in (None, len(data))


@given(integer_types)
def test_limits_are_enforced(data_type: DataType) -> None:
    assert data_type.limits is not None
    low, high = data_type.limits
    assert (data_type.decode(data_type.encode(low)), data_type.decode(data_type.encode(high))) == (low, high)
    for value in (low - 1, high + 1):
        with pytest.raises(ValueError, match=re.escape(f"({low}..{high})")):
            data_type.encode(value)


@pytest.mark.parametrize(
    ("short", "text", "data"),
    [
        ("i8", "-128", "80"),
        ("i8", "127", "7F"),
        ("i16", "-1500", "24 FA"),
        ("i16", "-0x8000", "00 80"),
        ("i24", "-1", "FF FF FF"),
        ("i32", "-2147483648", "00 00 00 80"),
        ("i64", "-0x8000000000000000", "00 00 00 00 00 00 00 80"),
        ("u8", "0xff", "FF"),
        ("u16", "0x201", "01 02"),
        ("u32", "0XC0000401", "01 04 00 C0"),
        ("u32", "500000", "20 A1 07 00"),
        ("u64", "18446744073709551615", "FF FF FF FF FF FF FF FF"),
        ("bool", "true", "01"),
        ("bool", "0", "00"),
        ("r32", "-1.5", "00 00 C0 BF"),
        ("vs", "save", "73 61 76 65"),
        ("us", "Hi", "48 00 69 00"),
        ("os", "0xDEADbeef", "DE AD BE EF"),
        ("domain", "de ad", "DE AD"),
        ("t", "2:1000", "E8 03 00 00 02 00"),
    ],
)
def test_what_is_typed(short: str, text: str, data: str) -> None:
    assert BY_SHORT_NAME[short].parse(text) == bytes.fromhex(data)


@pytest.mark.parametrize(
    ("short", "text"),
    [
        ("u8", "256"),
        ("u8", "-1"),
        ("bool", "2"),
        ("bool", "maybe"),
        ("i16", "0x8000"),
        ("u16", "1.5"),
        ("u32", "0x1_0"),
        ("u32", "0x5 "),
        ("u32", "0x"),
        ("u32", "٣"),
        ("u32", "201h"),
        ("r32", "1e39"),
        ("r32", "one"),
        ("vs", "\N{EURO SIGN}"),
        ("os", "0xABC"),
        ("t", "5"),
        ("t", "70000:0"),
        ("t", f"0:{1 << 28}"),  # CiA 301: 28 bits of milliseconds
    ],
)
def test_what_does_not_fit_is_a_value_error(short: str, text: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 - the words are the type's own
        BY_SHORT_NAME[short].parse(text)


@given(types, st.text(max_size=12))
def test_junk_is_read_or_refused_with_value_error(data_type: DataType, text: str) -> None:
    try:
        data = data_type.parse(text)
    except ValueError:
        return
    assert data_type.size in (None, len(data))


@given(types, st.binary(max_size=12))
def test_any_bytes_decode_or_are_refused_with_value_error(data_type: DataType, data: bytes) -> None:
    try:
        data_type.decode(data)
    except ValueError:
        assert data_type.size not in (None, len(data))


@given(
    types, st.one_of(st.none(), st.integers(), st.floats(), st.text(), st.binary(), st.just(CanopenTime(1 << 28, 0)))
)
def test_any_value_encodes_or_is_refused_with_value_error(data_type: DataType, value: Value) -> None:
    try:
        data = data_type.encode(value)
    except ValueError:
        return
    assert data_type.size in (None, len(data))


@given(st.one_of(st.text(max_size=12), st.from_regex(r"-?(0x)?[0-9a-fA-F_ +]+", fullmatch=True)))
def test_numbers_are_decimal_or_0x(text: str) -> None:
    match = re.fullmatch(r"(-?)(?:(\d{1,40})|0[xX]([0-9a-fA-F]{1,38}))", text, re.ASCII)
    if match is None:
        with pytest.raises(ValueError, match="is not a number"):
            parse_number(text)
        return
    number = int(match[2]) if match[2] else int(match[3], 16)
    assert parse_number(text) == (-number if match[1] else number)


DAY_MS = 24 * 3600 * 1000


@pytest.mark.parametrize(
    ("code", "time", "text"),
    [
        (0x0C, CanopenTime(0, 0), "1984-01-01 00:00:00.000"),
        (0x0C, CanopenTime(DAY_MS // 2 + 7, 15673), "2026-11-29 12:00:00.007"),
        (0x0C, CanopenTime(DAY_MS - 1, 0xFFFF), "2163-06-06 23:59:59.999"),
        (0x0D, CanopenTime(3_723_004, 3), "3 d 01:02:03.004"),
        (0x0D, CanopenTime(0, 0), "0 d 00:00:00.000"),
        (0x0D, CanopenTime((1 << 28) - 1, 0xFFFF), "65535 d 74:33:55.455"),
    ],
)
def test_a_time_is_shown_as_it_is_typed(code: int, time: CanopenTime, text: str) -> None:
    kind = DATA_TYPES[code]
    data = kind.encode(time)
    assert str(kind.decode(data)) == text
    assert kind.decode(data) == time
    assert kind.parse(text) == data
    assert kind.parse(f"{time.days}:{time.milliseconds}") == data


@pytest.mark.parametrize("text", ["2026-13-01 00:00:00", "1983-12-31 00:00:00", "noon", "3 d", "2200-01-01 00:00:00"])
def test_what_is_no_time_is_refused(text: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 - the words are of several readers
        DATA_TYPES[0x0C].parse(text)


@pytest.mark.parametrize(
    ("kind", "text", "said"),
    [
        ("os", "@file", "bytes in hexadecimal"),
        ("domain", "0x1", "bytes in hexadecimal"),
        ("r32", "fast", "'fast' is not a number"),
        ("t", "5", "2026-11-29 12:00:00"),
        ("td", "", "3 d 01:02:03.004"),
        ("t", "2026-13-01 00:00:00", "2026-13-01 is not a date"),
    ],
)
def test_what_is_typed_wrong_is_told_in_the_users_words(kind: str, text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        BY_SHORT_NAME[kind].parse(text)


def test_a_value_of_another_kind_is_refused_with_the_range() -> None:
    for value in (1.5, "x", b"x"):
        with pytest.raises(ValueError, match=r"^.+ is no value of UNSIGNED16 \(0\.\.65535\)$"):
            BY_SHORT_NAME["u16"].encode(value)
    with pytest.raises(ValueError, match=r"^1 is no value of VISIBLE_STRING$"):
        BY_SHORT_NAME["vs"].encode(1)

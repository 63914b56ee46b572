"""Numbers and typed values as files write them."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.datatypes import BY_SHORT_NAME, DATA_TYPES, DataType, Kind
from dvtcli.files.eds.numbers import encode_value, leading_zero_remark, read_limit, read_number

INTEGERS = [t for t in DATA_TYPES.values() if t.kind in (Kind.INTEGER, Kind.UNSIGNED)]


def decoded(short: str, text: str) -> object:
    data_type = BY_SHORT_NAME[short]
    return data_type.decode(encode_value(data_type, text).data)


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("16", 16),
        ("0x10", 16),
        ("0X1f", 31),
        ("020", 16),
        ("0", 0),
        ("00000000", 0),
        ("08", 8),
        ("-5", -5),
        ("+5", 5),
        ("1;", 1),
        ("1 ; one", 1),
    ],
)
def test_number(text: str, number: int) -> None:
    assert read_number(text) == number


@pytest.mark.parametrize("text", ["", "x", "1e3", "1.5", "0x", "0xG", "1_000", "١", "--1", "9" * 5000])
def test_no_number(text: str) -> None:
    with pytest.raises(ValueError, match="not a number"):
        read_number(text)


@pytest.mark.parametrize(("text", "said"), [("010", "octal"), ("08", "not octal"), ("07", ""), ("10", ""), ("0", "")])
def test_leading_zero_is_remarked_where_it_matters(text: str, said: str) -> None:
    remark = leading_zero_remark(text)
    assert said in remark
    assert bool(said) == bool(remark)


@pytest.mark.parametrize(
    ("short", "text", "value"),
    [
        ("i16", "0xFFFF", -1),
        ("i16", "65535", -1),
        ("i8", "0xFD", -3),
        ("i8", "0xFFFFFFFE", -2),
        ("i32", "0x80000001", -2147483647),
        ("i64", "0xFFFFFFFFFFFFFFFF", -1),
        ("i24", "0x800000", -(1 << 23)),
        ("u8", "255;", 255),
        ("bool", "1", True),
        ("bool", "true", True),
        ("r32", "0.5", 0.5),
        ("r32", "0x3F800000", 1.0),
        ("r32", "-1e3", -1000.0),
        ("r64", "0x3FF0000000000000", 1.0),
        ("vs", "a;b", "a;b"),
        ("vs", "0x10", "0x10"),
        ("us", "größer", "größer"),
        ("os", "0xABCD", b"\xab\xcd"),
        ("os", "01 02 ff", b"\x01\x02\xff"),
        ("domain", "0x0", b"\0"),
        ("t", "0x1", (1, 0)),
        ("td", "3:10", (10, 3)),
    ],
)
def test_value(short: str, text: str, value: object) -> None:
    assert decoded(short, text) == value


@pytest.mark.parametrize(
    ("short", "text", "said"),
    [
        ("u8", "256", "does not fit"),
        ("u8", "-1", "does not fit"),
        ("u8", "true", "not a number"),
        ("i16", "0x1FFFF", "does not fit"),
        ("bool", "2", "does not fit"),
        ("u32", "$NODEID+$NODEID", "twice"),
        ("u32", "$NODEID*2", "not a number"),
        ("u32", "$NODE", "not a number"),
        ("u32", "$NODEID-1", "not a number"),
        ("r32", "0x123456789", "more than the 32 bits"),
        ("r32", "1,5", "could not convert"),
        ("r32", "1_0", "not a number"),
        ("r32", "1e99", "does not fit"),
        ("vs", "5 Ω", "'Ω' is not one of the characters of a VISIBLE_STRING"),
        ("os", "xyz", "hexadecimal bytes"),
        ("os", "123", "hexadecimal bytes"),
        ("t", "0x1FFFFFFFFFFFF", "48 bits"),
        ("t", "1:2:3", "not a number"),
    ],
)
def test_value_that_does_not_fit(short: str, text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        encode_value(BY_SHORT_NAME[short], text)


@pytest.mark.parametrize(
    ("text", "base"),
    [
        ("$NODEID+0x180", 0x180),
        ("0x180+$NODEID", 0x180),
        ("$NodeID + 0x180", 0x180),
        ("  $nodeid+ 0x180 ; comment", 0x180),
        ("0x40000000+$NODEID+0x180", 0x40000180),
        ("$NODEID", 0),
        ("$MY_NODE_ID+0x200", 0x200),
    ],
)
def test_node_id(text: str, base: int) -> None:
    value = encode_value(BY_SHORT_NAME["u32"], text)
    assert (int.from_bytes(value.data, "little"), value.relative) == (base, True)
    assert bool(value.remark) == ("MY_" in text)


def test_a_text_may_begin_with_a_dollar_sign() -> None:
    assert encode_value(BY_SHORT_NAME["vs"], "$NODEID").relative is False


@pytest.mark.parametrize(
    ("short", "text", "limit"),
    [
        ("i16", "0x8000", (-32768, False)),
        ("u32", "$NODEID+1", (1, True)),
        ("r32", "-1.5", (-1.5, False)),
        ("r32", "0x40000000", (2.0, False)),
        ("u8", "0xFF ; max", (255, False)),
    ],
)
def test_limit(short: str, text: str, limit: tuple[object, bool]) -> None:
    assert read_limit(BY_SHORT_NAME[short], text) == limit


@pytest.mark.parametrize(("short", "text"), [("r32", "0xFFFFFFFF"), ("r32", "inf"), ("vs", "1"), ("u8", "300")])
def test_senseless_limit(short: str, text: str) -> None:
    with pytest.raises(ValueError, match=r"not a finite|no limits|does not fit"):
        read_limit(BY_SHORT_NAME[short], text)


@given(st.sampled_from(INTEGERS), st.data())
def test_integers_survive_every_spelling(data_type: DataType, data: st.DataObject) -> None:
    assert data_type.limits
    assert data_type.bits
    value = data.draw(st.integers(*data_type.limits))
    bits = value & ((1 << data_type.bits) - 1)
    for text in (str(value), f"0x{bits:X}", f"0x{bits:0{data_type.bits // 4}x}", f"{bits} ; bits"):
        assert data_type.decode(encode_value(data_type, text).data) == value


@given(st.integers(0, 0xFFFF_FFFF), st.integers(1, 127))
def test_cob_ids_survive_with_their_node_id(base: int, node_id: int) -> None:
    value = encode_value(BY_SHORT_NAME["u32"], f"$NODEID+0x{base:X}")
    assert int.from_bytes(value.data, "little") == base


@given(st.floats(width=32, allow_nan=False))
def test_reals_survive(value: float) -> None:
    pattern = struct.unpack("<I", struct.pack("<f", value))[0]
    for text in (repr(value), f"0x{pattern:08X}"):
        assert decoded("r32", text) == value

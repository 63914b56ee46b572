"""A raw value becomes a text that a person reads, and that text becomes the raw value again."""

from __future__ import annotations

import re
from contextlib import suppress
from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dvtcli.domain.datatypes import U32
from dvtcli.domain.object_dictionary import Access, ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.object_scalings import ObjectRange, ScalingRule, Standard
from dvtcli.domain.scaling import (
    Scaling,
    State,
    parse_exact_scale,
    parse_factor,
    parse_scale,
    scale_text,
    spelled,
    times,
)

SIXTEENTH, VOLT = Scaling("V", Fraction(1, 16)), Scaling("V", Fraction(1, 256))
CELSIUS = Scaling("°C", Fraction(1, 2), Fraction(-40))
MODE = Scaling(values={1: "profile position", 3: "profile velocity"})
WORD = Scaling(states=(State(0x6F, 0x27, "operation enabled"),), bits={0: "ready", 2: "enabled"})
ERRORS = Scaling(values={0: "no error"}, bits={1: "current", 3: "temperature"})

factors = st.one_of(
    st.sampled_from(["1/256", "1/16", "1/32767", "0.1", "0.001", "100", "100/255", "-1/4", "3"]).map(Fraction),
    st.fractions(min_value=Fraction(1, 10**6), max_value=1000, max_denominator=10**6).filter(bool),
)
offsets = st.one_of(st.just(Fraction(0)), st.fractions(min_value=-1000, max_value=1000, max_denominator=1000))
units = st.sampled_from(["V", "mA", "km/h", "rpm", "%", "°C", "Nm", "of rated", "m/s"])
raws = st.integers(-(1 << 31), (1 << 32) - 1)


@given(raws, factors, offsets, units)
def test_what_is_shown_can_be_typed_back(raw: int, factor: Fraction, offset: Fraction, unit: str) -> None:
    meaning = Scaling(spelled(unit), factor, offset)
    assert meaning.to_raw(meaning.text(raw)) == raw
    assert meaning.to_raw(meaning.quantity(raw)) == raw
    assert meaning.to_physical(raw) == raw * factor + offset
    # and no digit is wasted: with one less, two raw values would look the same, or it is a whole number
    assert len({meaning.quantity(raw), meaning.quantity(raw + 1), meaning.quantity(raw - 1)}) == 3


@pytest.mark.parametrize(
    ("meaning", "raw", "number"),
    [(Scaling("V"), 5, 5), (Scaling("V", Fraction(2), Fraction(1)), 5, 11), (Scaling("V", Fraction(1, 2)), 5, 2.5),
     (Scaling("V"), 5.0, 5.0), (Scaling("V", Fraction(2)), 0.5, 1.0)],
)  # fmt: skip
def test_a_number_is_whole_if_all_of_its_kind_are(meaning: Scaling, raw: float, number: float) -> None:
    found = meaning.number(raw)
    assert (found, type(found)) == (number, type(number))


@given(
    st.integers(-10_000, 10_000),
    st.sampled_from([("V", "mV", 1000), ("mA", "A", Fraction(1, 1000)), ("m/s", "mm/s", 1000)]),
)
def test_prefixes_of_the_same_unit(count: int, names: tuple[str, str, int | Fraction]) -> None:
    unit, other, ratio = names
    meaning = Scaling(unit, Fraction(1, 10))
    number = count * Fraction(1, 10) * ratio
    text = f"{number.numerator}" if number.denominator == 1 else f"{float(number):.4f}"
    assert meaning.to_raw(f"{text} {other}") == count
    assert times(unit, other) == ratio


@pytest.mark.parametrize(
    ("meaning", "raw", "text"),
    [
        (SIXTEENTH, 768, "48.0 V (768)"),
        (VOLT, 6000, "23.438 V (6000)"),
        (VOLT, -3, "-0.012 V (-3)"),
        (CELSIUS, 0, "-40.0 °C (0)"),
        (Scaling("ms"), 1000, "1000 ms"),
        (Scaling("µs", Fraction(100)), 5, "500 µs (5)"),
        (Scaling(factor=Fraction(1, 32767)), 16384, "0.50002 (16384)"),
        (MODE, 3, "profile velocity (3)"),
        (MODE, 9, ""),
        (WORD, 0x0237, "operation enabled (0x0237)"),
        (WORD, 0, ""),
        (ERRORS, 0, "no error (0x0000)"),
        (ERRORS, 0x4A, "current, temperature, bit 6 (0x004A)"),
        (Scaling("V"), 1.5, "1.5 V"),
        (Scaling(), 5, ""),
        (SIXTEENTH, b"\1\2", ""),
    ],
)
def test_what_a_person_reads(meaning: Scaling, raw: int, text: str) -> None:
    assert meaning.text(raw, 16) == text


@pytest.mark.parametrize(
    ("meaning", "text", "raw"),
    [
        (SIXTEENTH, "48V", 768), (SIXTEENTH, "48.0 V", 768), (SIXTEENTH, "48000 mV", 768), (SIXTEENTH, "0.048kV", 768),
        (SIXTEENTH, "48.0 V (768)", 768), (SIXTEENTH, "48.0 V (0x300)", 768), (SIXTEENTH, "4.8e1 V", 768),
        (SIXTEENTH, "48", None), (SIXTEENTH, "0x30", None), (SIXTEENTH, "-0x30", None), (SIXTEENTH, "high", None),
        (VOLT, "23.4 V", 5990), (CELSIUS, "25 degC", 130), (CELSIUS, "-40°C", 0),
        (MODE, "Profile_Velocity", 3), (MODE, "profile velocity (3)", 3), (MODE, "3", None), (MODE, "homing", None),
        (Scaling("ms"), "1s", 1000), (Scaling("µs"), "20 ms", 20_000), (Scaling("us"), "1 us", None),
        (Scaling(factor=Fraction(1, 4)), "0.5 (2)", 2), (Scaling(), "5 V", None),
    ],
)  # fmt: skip
def test_what_a_person_types(meaning: Scaling, text: str, raw: int | None) -> None:
    if meaning.unit == "us":
        meaning = Scaling(spelled(meaning.unit))
        raw = 1
    assert meaning.to_raw(text) == raw


SIGNS = Scaling(values={500: "+10 V", 1000: "-10 V", 7: "500", 8: "0x1F4", 9: "0500", 3: "< 5", 4: "> 5"})


@pytest.mark.parametrize(
    ("text", "raw"),
    [
        ("+10 V", 500), ("-10 V", 1000), (" +10_v ", 500), ("-10 V (1000)", 1000), ("+10 V (1000)", None),
        ("10 V", None), ("<5", None), ("< 5", 3), ("> 5", 4), ("500", None), ("0x1F4", None), ("0500", None),
        ("500 (7)", 7),
    ],
)  # fmt: skip
def test_a_word_keeps_its_sign_and_a_number_alone_is_raw(text: str, raw: int | None) -> None:
    assert SIGNS.to_raw(text) == raw


def test_the_sign_of_the_only_word_counts_too() -> None:
    one = Scaling("V", values={500: "+10 V"})
    assert (one.to_raw("-10 V"), one.to_raw("+10 V")) == (-10, 500)
    assert Scaling(values={7: "1.5"}).to_raw("1.5", whole=False) is None
    assert Scaling(values={0: "+1,", 2: "-1."}).to_raw("+1") is None


def test_words_that_are_one_but_for_their_spelling_are_told_apart_by_it() -> None:
    twins = Scaling(values={1: "quick stop", 2: "Quick-Stop", 3: "off", 4: "off"})
    assert (twins.to_raw("quick stop"), twins.to_raw("Quick-Stop"), twins.to_raw("QUICK STOP (2)")) == (1, 2, 2)
    for text, says in (("QUICK STOP", "'quick stop' (1) or 'Quick-Stop' (2)"), ("off", "'off' (3) or 'off' (4)")):
        with pytest.raises(ValueError, match=re.escape(says)):
            twins.to_raw(text)


@given(st.dictionaries(st.integers(0, 99), st.text("+-<>1 aA_.,", max_size=4), max_size=6), st.integers(0, 99))
@example({0: "+1,"}, 1)
def test_a_word_never_writes_another_ones_value(values: dict[int, str], raw: int) -> None:
    meaning = Scaling(values=values)
    word = values.get(raw, "+1")
    with suppress(ValueError):
        found = meaning.to_raw(word)
        assert found is None or values[int(found)] == word
    if raw in values:
        with suppress(ValueError):
            assert meaning.to_raw(meaning.text(raw)) in (raw, None)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("48 mA", "it is in V, mV, kV, not in mA"), ("48 rpm", "not in rpm"),
        ("48.01 V", "48.0 V (768) and 48.06 V (769)"),
        ("1 mV", "the nearest values are 0.0 V (0) and 0.06 V (1)"), ("48.0 V (769)", "48.0 V is 768 raw, not 769"),
        ("48.0 (768)", "not a number alone"),
    ],
)  # fmt: skip
def test_what_is_refused(text: str, says: str) -> None:
    with pytest.raises(ValueError, match=re.escape(says)):
        SIXTEENTH.to_raw(text)


def test_a_real_number_needs_no_counts() -> None:
    assert Scaling("V", Fraction(1, 10)).to_raw("0.123 V", whole=False) == pytest.approx(1.23)


@pytest.mark.parametrize(
    ("text", "factor", "unit"),
    [
        ("1/256 V", "1/256", "V"), ("0.25 V", "1/4", "V"), ("100 us", "100", "µs"), ("0.1%", "1/10", "%"),
        ("1/32767", "1/32767", ""), ("0.001 of rated", "1/1000", "of rated"), ("rpm", "1", "rpm"), ("", "1", ""),
        ("degC", "1", "°C"), ("2 decimals", "1", "2 decimals"), ("8.8 (rad/s)", "1", "8.8 (rad/s)"), ("-", "1", ""),
        ("1/min", "1", "rpm"), ("0.0 V", "1", "0.0 V"), ("1/0 V", "1", "1/0 V"),
    ],
)  # fmt: skip
def test_how_files_write_a_unit(text: str, factor: str, unit: str) -> None:
    assert parse_scale(text) == (Fraction(factor), unit)
    shown = scale_text(*parse_scale(text))
    assert parse_scale(shown) == parse_scale(text) or not text


@pytest.mark.parametrize(
    ("text", "factor", "unit"),
    [
        ("2 V", "2", "V"), ("5V", "5", "V"), ("3e-05 rpm", "3/100000", "rpm"), ("1/256 V", "1/256", "V"),
        ("0.25", "1/4", ""), ("rpm", "1", "rpm"), ("1/min", "1", "rpm"), ("1/s", "1", "1/s"), ("-1 A", "-1", "A"),
        ("1e5 1/s", "100000", "1/s"), ("10 1/s", "10", "1/s"), ("0.1 1/s", "1/10", "1/s"), ("5 m2", "5", "m2"),
    ],
)  # fmt: skip
def test_a_number_in_a_profile_is_a_factor(text: str, factor: str, unit: str) -> None:
    assert parse_exact_scale(text) == (Fraction(factor), unit)


@pytest.mark.parametrize("text", ["0 V", "1/0 V", "2 3 V", "8.8 (rad/s)", "1.2.3", "1/3e5 V", "1000/2^12 A", "0x10 V"])
def test_a_scale_of_a_profile_that_is_neither_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"factor|count"):
        parse_exact_scale(text)


@given(
    st.integers(1, 999_999_999),
    st.integers(-12, 9),
    st.sampled_from(["", "V", "°C", "rpm", "%", "of rated", "N·m", "m/s²", "1/s"]),
)
def test_a_profile_reads_what_is_shown(digits: int, exponent: int, unit: str) -> None:
    factor = Fraction(digits) * Fraction(10) ** exponent
    assert parse_exact_scale(scale_text(factor, unit) or "1") == (factor, unit)
    assert parse_exact_scale(scale_text(Fraction(1, digits), unit) or "1")[1] == unit


@given(st.text(max_size=30))
def test_any_text_is_a_unit_or_a_factor_or_refused(text: str) -> None:
    factor, _ = parse_scale(text)
    assert factor > 0
    with suppress(ValueError):
        assert parse_factor(text)
    for meaning in (SIXTEENTH, MODE, WORD, Scaling()):
        with suppress(ValueError):
            assert isinstance(meaning.to_raw(text), int | None)


@given(st.integers(0, 0xFFFF_FFFF))
def test_every_bit_that_is_set_has_a_name(raw: int) -> None:
    assert len(ERRORS.set_bits(raw)) == raw.bit_count()


@pytest.mark.parametrize("text", ["٣", "٣ V", "3٣ V", "3 V (٣)"])
def test_digits_of_other_scripts_are_no_number(text: str) -> None:
    assert VOLT.to_raw(text) is None


def test_raw_stands_beside_a_word_unless_the_word_is_its_quantity() -> None:
    named = Scaling("V", values={5: "5 V", 6: "six"})
    assert [named.text(raw) for raw in (5, 6, 7)] == ["5 V", "six (6)", "7 V"]
    assert Scaling("V", Fraction(1, 2), values={5: "2.5 V"}).text(5) == "2.5 V (5)"


def described(device_type: int, names: dict[int, str]) -> ObjectDictionary:
    """A device of this type (0x1000) with objects of these names."""

    def held(index: int, name: str, default: bytes) -> OdObject:
        return OdObject(index, name, ObjectType.VAR, {0: OdEntry(index, 0, name, U32, Access.RO, default=default)})

    objects = {0x1000: held(0x1000, "Device type", device_type.to_bytes(4, "little"))}
    return ObjectDictionary(objects | {index: held(index, name, bytes(4)) for index, name in names.items()})


@pytest.mark.parametrize(
    ("device_type", "index", "name", "known"),
    [
        (0x0002_0192, 0x6064, "", True),
        (0x0002_0192, 0x6864, "", True),  # of the second axis
        (0x0002_0192, 0x6065, "", False),
        (0x0003_0191, 0x6064, "Position actual value", True),  # a drive's object in an I/O module's file
        (0x0003_0191, 0x6864, "Position actual value", True),
        (0x0003_0191, 0x6064, "Limit", False),
        (0x0003_0191, 0x6064, "", False),
    ],
)
def test_a_profile_counts_for_its_devices_and_for_objects_with_its_names(
    device_type: int, index: int, name: str, known: bool
) -> None:
    rules = {ObjectRange(0x6064, 0x6064): ScalingRule(SIXTEENTH)}
    profile = Standard(402, rules, {0x6064: "position_actual_value"})
    dictionary = described(device_type, {index: name} if name else {})
    assert profile.rule(index, 0, dictionary) == (SIXTEENTH if known else None)
    assert profile.rule(index, 0, None) == (None if index == 0x6065 else SIXTEENTH)

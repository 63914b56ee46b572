from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.pdo import DUMMY_BITS, PdoMappingEntry, split_dummy, total_bits


@given(st.integers(0, 0xFFFF_FFFF))
def test_every_word_survives(raw: int) -> None:
    assert PdoMappingEntry.from_raw(raw).raw == raw


def test_word_and_text() -> None:
    entry = PdoMappingEntry.from_raw(0x6C01_0110)
    assert entry == PdoMappingEntry(0x6C01, 1, 16)
    assert (str(entry), entry.object, entry.is_dummy) == ("6C01:01/16", "6C01:01", False)


@pytest.mark.parametrize(("raw", "dummy"), [(0x0001_0001, True), (0x0007_0020, True), (0x0008_0020, False), (0, False)])
def test_dummies_are_the_first_seven_types(raw: int, dummy: bool) -> None:
    assert PdoMappingEntry.from_raw(raw).is_dummy is dummy


def test_a_sub_index_makes_it_no_dummy() -> None:
    assert not PdoMappingEntry(0x0005, 1, 8).is_dummy


@pytest.mark.parametrize("fields", [(0x10000, 0, 8), (0x6000, 0x100, 8), (0x6000, 0, 256), (-1, 0, 8)])
def test_fields_are_limited(fields: tuple[int, int, int]) -> None:
    with pytest.raises(ValueError, match="does not fit its fields"):
        PdoMappingEntry(*fields)


def fewest(bits: int, sizes: set[int]) -> int | None:
    """How many of *sizes* add up to *bits*, by trying all counts."""
    for count in range(bits + 1):
        if any(sum(chosen) == bits for chosen in itertools.combinations_with_replacement(sorted(sizes), count)):
            return count
    return None


@given(st.integers(1, 24), st.sets(st.sampled_from(sorted(DUMMY_BITS)), min_size=1))
def test_a_split_is_exact_and_as_short_as_possible(bits: int, usable: set[int]) -> None:
    wanted = fewest(bits, {DUMMY_BITS[index] for index in usable})
    if wanted is None:
        with pytest.raises(ValueError, match=f"{bits} bits cannot be skipped"):
            split_dummy(bits, usable)
        return
    entries = split_dummy(bits, usable)
    assert total_bits(entries) == bits
    assert len(entries) == wanted
    assert all(entry.is_dummy and entry.index in usable for entry in entries)
    assert all(entry.bits == DUMMY_BITS[entry.index] for entry in entries)


@pytest.mark.parametrize(
    ("bits", "usable", "words"),
    [
        (16, {1, 2, 3, 4}, [0x0003_0010]),
        (16, {1, 5, 6, 7}, [0x0006_0010]),
        (64, {1, 5, 6, 7}, [0x0007_0020, 0x0007_0020]),
        (5, {1}, [0x0001_0001] * 5),
        (24, set(DUMMY_BITS), [0x0003_0010, 0x0002_0008]),
        (0, {1}, []),
    ],
)
def test_splits_of_the_notes(bits: int, usable: set[int], words: list[int]) -> None:
    assert [entry.raw for entry in split_dummy(bits, usable)] == words


def test_the_error_names_what_the_device_has() -> None:
    with pytest.raises(
        ValueError, match=r"4 bits cannot be skipped with the dummies of the device \(0005/8, 0006/16\)"
    ):
        split_dummy(4, {5, 6})
    with pytest.raises(ValueError, match=r"\(none\)"):
        split_dummy(8, ())

"""Objects as people write them: what is one object, whatever the notation, and what keeps its own meaning."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.object_syntax import MappedObject, has_sub_index, parse_object, resolve_entry


@given(st.integers(0, 0xFFFF), st.integers(0, 0xFF), st.sampled_from(["0x", "0X", ""]), st.sampled_from(":."))
def test_a_point_is_a_colon(index: int, sub_index: int, prefix: str, sign: str) -> None:
    written = f"{prefix}{index:04X}{sign}{sub_index:X}"
    assert parse_object(written) == (index, sub_index)
    assert has_sub_index(written)
    assert not has_sub_index(f"{prefix}{index:04X}")


@given(st.integers(0, 0xFFFF), st.integers(1, 64))
def test_behind_a_slash_stands_a_length_but_0_is_none(index: int, bits: int) -> None:
    assert resolve_entry(f"{index:04X}/{bits}", None) == MappedObject(index, 0, bits)
    assert resolve_entry(f"{index:04X}/0", None) == MappedObject(index, 0)
    assert parse_object(f"{index:04X}/{bits}") is None


@pytest.mark.parametrize("name", ["Analogue input.1", "6041.123", "6041./", "6041/000", "604.1"])
def test_a_name_with_a_point_stays_a_name(name: str) -> None:
    assert parse_object(name) is None

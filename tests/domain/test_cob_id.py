from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.cob_id import CobId

words = st.integers(0, 0xFFFF_FFFF)


@given(words)
def test_every_word_survives(raw: int) -> None:
    assert CobId.from_raw(raw).raw == raw


@given(words)
def test_disabling_and_enabling_change_bit_31_alone(raw: int) -> None:
    cob_id = CobId.from_raw(raw)
    assert cob_id.disabled().raw == raw | 0x8000_0000
    assert cob_id.enabled().raw == raw & 0x7FFF_FFFF


@pytest.mark.parametrize(
    ("raw", "can_id", "valid", "rtr_allowed", "extended"),
    [
        (0x0000_0201, 0x201, True, True, False),
        (0xC000_0401, 0x401, False, False, False),
        (0x4000_0181, 0x181, True, False, False),
        (0x2001_2345, 0x12345, True, True, True),
        (0x9FFF_FFFF, 0x1FFF_FFFF, False, True, False),
    ],
)
def test_bits(raw: int, can_id: int, valid: bool, rtr_allowed: bool, extended: bool) -> None:
    assert CobId.from_raw(raw) == CobId(can_id, valid, rtr_allowed, extended)


@pytest.mark.parametrize("raw", [-1, 0x1_0000_0000])
def test_a_word_has_32_bits(raw: int) -> None:
    with pytest.raises(ValueError, match="32 bits"):
        CobId.from_raw(raw)


@pytest.mark.parametrize("can_id", [-1, 0x2000_0000])
def test_a_can_id_has_29_bits(can_id: int) -> None:
    with pytest.raises(ValueError, match="CAN-ID"):
        CobId(can_id)


def test_frame_format_and_text() -> None:
    assert CobId(0x7FF).fits_frame
    assert not CobId(0x800).fits_frame
    assert CobId(0x800, extended=True).fits_frame
    assert (str(CobId(0x81)), str(CobId(0x12345, extended=True))) == ("0x081", "0x00012345")

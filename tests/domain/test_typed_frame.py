"""Frames as people write them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.ports import Frame
from dvtcli.domain.typed_frame import frame_text, typed_frame
from tests.drawn_frames import drawn

FRAMES = drawn(
    st.integers(0, 0x7FF),
    st.binary(max_size=8),
) | drawn(st.integers(0, 0x1FFF_FFFF), st.binary(max_size=8), extended=st.just(True))


@given(FRAMES)
def test_what_is_written_is_read(frame: Frame) -> None:
    assert typed_frame(frame_text(frame)) == frame
    digits, dump = f"{frame.can_id:0{8 if frame.extended else 3}X}", frame.data.hex(" ").upper()
    assert typed_frame(f"(1732320000.000001)  can0  {digits}   [{len(frame.data)}]  {dump}") == frame
    assert typed_frame(f"0x{digits} {dump}") == frame


@given(st.text(max_size=60) | st.text("0123456789abcdefABCDEFR#[]() x", max_size=60))
def test_any_text_is_a_frame_or_said_to_be_none(text: str) -> None:
    try:
        frame = typed_frame(text)
    except ValueError:
        return  # and nothing else is raised
    assert typed_frame(frame_text(frame)) == frame


@pytest.mark.parametrize(
    ("text", "frame"),
    [
        ("185#10.27", Frame(0x185, b"\x10\x27")),
        ("701#R", Frame(0x701, b"", remote=True)),
        ("181#R6", Frame(0x181, b"", remote=True, dlc=6)),
        ("can0  181   [6]  remote request", Frame(0x181, b"", remote=True, dlc=6)),
        ("  can0  705   [1]  7F   'x'", Frame(0x705, b"\x7f")),
        ("(1.5) can0 00000185#1027", Frame(0x185, b"\x10\x27", extended=True)),
        ("can0  601   [0]  remote request", Frame(0x601, b"", remote=True)),
    ],
)
def test_other_ways_of_writing(text: str, frame: Frame) -> None:
    assert typed_frame(text) == frame


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("185##1027", "CAN FD"),
        ("185#102", "half a byte"),
        ("20000000#", "29 bits"),
        ("999#00", "0x999 is above 0x7FF: a CAN-ID of 29 bits has 8 digits, 00000999"),
        ("0x800 00", "8 digits, 00000800"),
        ("185#112233445566778899", "8 at most"),
        ("0x185 [3] 10 27", "differs from"),
        ("", "not a frame"),
        ("drive", "not a frame"),
    ],
)
def test_what_is_no_frame_says_why(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        typed_frame(text)


def test_a_frame_is_a_line_of_400_characters_at_most() -> None:
    frame = " 185#1027"
    assert typed_frame(frame.rjust(400, "x")) == Frame(0x185, b"\x10\x27")
    with pytest.raises(ValueError, match="one short line"):
        typed_frame(frame.rjust(401, "x"))

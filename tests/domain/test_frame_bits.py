"""Bits of a frame: by hand, by the figures that are known, and by a second, bit-wise reckoning."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.frame_bits import (
    INTERFRAME,
    TRAILER,
    _crc_table,
    _stuff_table,
    arbitration,
    frame_bits,
    header,
    least_frame_bits,
    most_frame_bits,
)
from dvtcli.domain.ports import Frame


@pytest.fixture(autouse=True)
def no_tables() -> None:
    """Each test makes the tables that are otherwise made once: any of them may show a fault there."""
    for made in (_crc_table, _stuff_table):
        made.cache_clear()


def unstuffed_bits(length: int, extended: bool = False, remote: bool = False) -> int:
    """What a frame with *length* bytes takes at least: no stuff bit, but the gap behind it."""
    return stuffed_length(length, extended, remote) + TRAILER + INTERFRAME


def stuffed_length(length: int, extended: bool, remote: bool) -> int:
    """From the start of frame to the CRC's end: the bits that stuff bits go between."""
    return header(0, length, extended, remote)[1] + 8 * length * (not remote) + 15


def worst_case_bits(length: int, extended: bool = False, remote: bool = False) -> int:
    """For the unluckiest CAN-ID and data: the first stuff bit needs 5 equal bits, each later one only 4."""
    return unstuffed_bits(length, extended, remote) + (stuffed_length(length, extended, remote) - 1) // 4


def bitwise(frame: Frame) -> str:
    """The stuffed bits of *frame* up to its CRC, one after the other as a controller sends them."""
    bits = "0"
    if frame.extended:
        bits += f"{frame.can_id >> 18:011b}11{frame.can_id & 0x3FFFF:018b}{frame.remote:b}00"
    else:
        bits += f"{frame.can_id:011b}{frame.remote:b}00"
    bits += f"{len(frame.data):04b}"
    bits += "" if frame.remote else "".join(f"{byte:08b}" for byte in frame.data)
    crc = 0
    for bit in bits:
        feedback = int(bit) ^ crc >> 14
        crc = (crc << 1 & 0x7FFF) ^ (0x4599 if feedback else 0)
    sent = ""
    for bit in bits + f"{crc:015b}":
        sent += bit
        if sent.endswith(("00000", "11111")):
            sent += "1" if bit == "0" else "0"
    return sent


def bits_of(frame: Frame) -> int:
    return frame_bits(frame.can_id, frame.data, frame.extended, frame.remote)


def stuffed_bitwise(frame: Frame) -> int:
    return len(bitwise(frame)) + 10 + INTERFRAME


frames = st.builds(
    lambda can_id, extended, data, remote: Frame(can_id if extended else can_id & 0x7FF, data, extended, remote),
    st.integers(0, 0x1FFF_FFFF),
    st.booleans(),
    st.lists(st.sampled_from([0x00, 0xFF, 0xF8, 0x07, 0xC3]) | st.integers(0, 255), max_size=8).map(bytes),
    st.booleans(),
)


@pytest.mark.parametrize(
    ("frame", "least", "bits"),
    [
        # 44 bits of overhead, 3 between frames, 64 of data: 111 without stuffing
        (Frame(0x555, bytes([0x55] * 8)), 111, 112),
        (Frame(0x080, b""), 47, 51),
        (Frame(0x12345678, bytes(8), extended=True), 131, 145),
        (Frame(0x181, b"\x37\x12", remote=True), 47, 48),
    ],
)
def test_known_frames(frame: Frame, least: int, bits: int) -> None:
    assert unstuffed_bits(len(frame.data), frame.extended, frame.remote) == least
    assert bits_of(frame) == bits == stuffed_bitwise(frame)


def test_a_sync_bit_by_bit() -> None:
    stuffed = "00001 00000(1) 00000(1) 0000 0(1) 0111 00000(1) 00101"
    header, crc = "0000100000000000000", "001110000000101"
    bits = stuffed.replace("(1)", "").replace(" ", "")
    assert bits == header + crc
    assert bitwise(Frame(0x080, b"")) == stuffed.replace("(", "").replace(")", "").replace(" ", "")
    assert bits_of(Frame(0x080, b"")) == frame_bits(0x080) == 19 + 15 + 4 + 10 + 3


@given(frames)
def test_the_tables_count_as_a_controller_does(frame: Frame) -> None:
    assert bits_of(frame) == stuffed_bitwise(frame)


@given(frames)
def test_stuffing_stays_within_its_worst_case(frame: Frame) -> None:
    length, *kind = len(frame.data), frame.extended, frame.remote
    assert unstuffed_bits(length, *kind) <= bits_of(frame) <= worst_case_bits(length, *kind)


@pytest.mark.parametrize(
    ("length", "extended", "remote", "least", "most"),
    [
        # the figures of the tables that everybody uses: 8n + 44 (64) without stuffing, 34 (54) + 8n bits to stuff
        (0, False, False, 47, 55),
        (8, False, False, 111, 135),
        (0, True, False, 67, 80),
        (8, True, False, 131, 160),
        (8, False, True, 47, 55),
        (8, True, True, 67, 80),
    ],
)
def test_least_and_most(length: int, extended: bool, remote: bool, least: int, most: int) -> None:
    assert unstuffed_bits(length, extended, remote) == least
    assert least_frame_bits(length, extended=extended, remote=remote) == least
    assert worst_case_bits(length, extended, remote) == most
    assert most_frame_bits(length, extended=extended, remote=remote) == most


def test_a_frame_is_one_of_11_bits_with_data_if_nothing_else_is_said() -> None:
    assert (least_frame_bits(8), most_frame_bits(8)) == (111, 135)


def test_stuff_bits_of_the_crc_count() -> None:
    """Some CRCs end in a run that needs a stuff bit behind its last bit."""
    behind = [Frame(can_id, b"") for can_id in range(0x800) if bitwise(Frame(can_id, b""))[-6:] in ("000001", "111110")]
    assert behind
    assert all(bits_of(frame) == stuffed_bitwise(frame) for frame in behind)


def test_every_byte_of_data_counts_as_a_controller_counts_it() -> None:
    for byte in range(256):
        frame = Frame(0x181, bytes([byte, 255 - byte]))
        assert bits_of(frame) == stuffed_bitwise(frame), byte


def test_arbitration_is_won_by_the_first_dominant_bit() -> None:
    """ISO 11898-1: the lower CAN-ID, data before a remote frame, 11 bits before 29 that begin with the same 11."""
    extended = 0x100 << 18
    winners_first = [
        (0x0FF, False, True), (0x100, False, False), (0x100, False, True), (extended, True, False),
        (extended, True, True), (extended | 1, True, False), (0x101, False, False), (0x101 << 18, True, False),
    ]  # fmt: skip
    ranks = [arbitration(can_id, extended=is_long, remote=remote) for can_id, is_long, remote in winners_first]
    assert ranks == sorted(set(ranks))

"""Bits of a frame: by hand, by the figures that are known, and by a second, bit-wise reckoning; and who goes first."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.ports import Frame
from dvtcli.simulator.wire import INTERFRAME, Wire, arbitration, frame_bits, unstuffed_bits


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
    assert unstuffed_bits(frame) == least
    assert frame_bits(frame) == bits == stuffed_bitwise(frame)


def test_a_sync_bit_by_bit() -> None:
    stuffed = "00001 00000(1) 00000(1) 0000 0(1) 0111 00000(1) 00101"
    header, crc = "0000100000000000000", "001110000000101"
    bits = stuffed.replace("(1)", "").replace(" ", "")
    assert bits == header + crc
    assert bitwise(Frame(0x080, b"")) == stuffed.replace("(", "").replace(")", "").replace(" ", "")
    assert frame_bits(Frame(0x080, b"")) == 19 + 15 + 4 + 10 + 3


@given(frames)
def test_the_tables_count_as_a_controller_does(frame: Frame) -> None:
    assert frame_bits(frame) == stuffed_bitwise(frame)


@given(frames)
def test_stuffing_stays_within_its_worst_case(frame: Frame) -> None:
    least = unstuffed_bits(frame)
    stuffed = least - 10 - INTERFRAME
    assert least <= frame_bits(frame) <= least + (stuffed - 1) // 4
    if not frame.extended and not frame.remote and len(frame.data) == 8:
        assert (least, least + (stuffed - 1) // 4) == (111, 135)


def test_the_lower_can_id_wins_and_a_base_frame_beats_its_extension() -> None:
    order = [
        Frame(0x000, b""),
        Frame(0x080, b""),
        Frame(0x181, b"x"),
        Frame(0x181, b"", remote=True),
        Frame(0x181 << 18, b"", extended=True),
        Frame(0x181 << 18 | 5, b"", extended=True),
        Frame(0x182, b""),
        Frame(0x7FF, b""),
    ]
    assert sorted(set(order), key=arbitration) == order


def test_who_waits_when_the_wire_becomes_free_competes_and_each_keeps_its_order() -> None:
    wire = Wire(1_000_000)
    first, later, urgent, late = Frame(0x700, b""), Frame(0x181, b""), Frame(0x080, b""), Frame(0x001, b"")
    wire.offer("a", first, 0.0)
    wire.offer("b", later, 10e-6)
    wire.offer("b", urgent, 10e-6)
    wire.offer("c", late, 1.0)
    arrived = []
    while (taken := wire.take(0.5)) is not None:
        arrived.append(taken)
    assert [(source, frame) for _, source, frame in arrived] == [("a", first), ("b", later), ("b", urgent)]
    times = [at_s for at_s, _, _ in arrived]
    assert times[0] == pytest.approx(frame_bits(first) * 1e-6)
    assert times[2] - times[1] == pytest.approx(frame_bits(urgent) * 1e-6)
    assert wire.next_s() == 1.0


def test_a_frame_that_begins_is_not_interrupted() -> None:
    wire = Wire(125_000)
    wire.offer("slow", Frame(0x7FF, bytes(8)), 0.0)
    assert wire.take(0.0001) is None
    wire.offer("urgent", Frame(0x000, b""), 0.0001)
    taken = wire.take(1.0)
    assert taken is not None
    assert taken[2].can_id == 0x7FF


def test_without_a_bit_rate_frames_come_in_order_and_at_once() -> None:
    wire = Wire()
    for number in (5, 3, 4):
        wire.offer("a", Frame(number, b""), 1.0)
    assert [taken[2].can_id for _ in range(3) if (taken := wire.take(1.0)) is not None] == [5, 3, 4]
    assert wire.take(1.0) is None
    assert wire.next_s() is None

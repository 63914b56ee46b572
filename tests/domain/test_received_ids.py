"""The last frames of a bus, heard at given times."""

from __future__ import annotations

import pytest

from dvtcli.domain.network.received_traffic import MOST_IDS, LastFrames
from dvtcli.domain.ports import Frame


def test_the_last_frame_and_its_period_are_kept() -> None:
    frames = LastFrames()
    assert frames.last(0x181) is None
    for at_s, byte in [(1.0, 1), (1.02, 2), (1.05, 3), (1.06, 4)]:
        frames.take(Frame(0x181, bytes([byte])), at_s)
    received = frames.last(0x181)
    assert received is not None
    assert received.period is not None
    assert (received.data, received.at_s) == (b"\x04", 1.06)
    assert (received.period.last_s, received.period.least_s, received.period.most_s) == pytest.approx(
        (0.01, 0.01, 0.03)
    )


def test_what_sets_a_pdo_otherwise_is_noted() -> None:
    """A download to its parameters by anybody, and a restart; an upload, and other objects, are none."""
    frames = LastFrames()
    tpdo1 = (0x1800, 0x1A00)
    for at_s, can_id, data in (
        (1.0, 0x601, "40 00 1A 01"), (2.0, 0x601, "2B 40 60 00"), (3.0, 0x602, "23 00 1A 01"), (4.0, 0x701, "05"),
        (5.0, 0x581, "23 00 1A 01"), (6.0, 0x601, "23 01 1A 01"),
    ):  # fmt: skip
        frames.take(Frame(can_id, bytes.fromhex(data)), at_s)
    assert frames.set_s(1, tpdo1) == float("-inf")
    frames.take(Frame(0x601, bytes.fromhex("23 00 1A 01 10 00 41 60")), 7.0)
    assert (frames.set_s(1, tpdo1), frames.set_s(2, tpdo1)) == (7.0, 3.0)
    frames.take(Frame(0x601, bytes.fromhex("C2 00 18 01")), 8.0)
    assert frames.set_s(1, tpdo1) == 8.0
    frames.take(Frame(0x701, b"\0"), 9.0)
    assert (frames.set_s(1, tpdo1), frames.set_s(1, (0x1801, 0x1A01))) == (9.0, 9.0)


def test_one_frame_has_no_period_and_a_remote_frame_is_none() -> None:
    frames = LastFrames()
    frames.take(Frame(0x181, b"\x05"), 1.0)
    frames.take(Frame(0x181, b"", remote=True), 2.0)
    received = frames.last(0x181)
    assert received is not None
    assert (received.data, received.period) == (b"\x05", None)
    assert frames.last(0x181, extended=True) is None


def test_the_can_id_that_was_silent_longest_is_forgotten() -> None:
    frames = LastFrames()
    frames.take(Frame(0x001, b""), 0.0)
    frames.take(Frame(0x002, b""), 0.0)
    frames.take(Frame(0x001, b""), 1.0)
    for can_id in range(0x100, 0x100 + MOST_IDS - 1):
        frames.take(Frame(can_id, b""), 2.0)
    assert frames.last(0x001) is not None
    assert frames.last(0x002) is None

"""Who goes first on a wire, and when a frame has arrived."""

from __future__ import annotations

import pytest

from dvtcli.domain.frame_bits import frame_bits
from dvtcli.domain.ports import Frame
from dvtcli.simulator.network.shared_bus import Wire, arbitration


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
    by_bits = sorted(set(order), key=lambda one: arbitration(one.can_id, extended=one.extended, remote=one.remote))
    assert by_bits == order


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
    assert times[0] == pytest.approx(frame_bits(first.can_id) * 1e-6)
    assert times[2] - times[1] == pytest.approx(frame_bits(urgent.can_id) * 1e-6)
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


@pytest.mark.parametrize("bit_rate", [None, 125_000])
def test_who_has_too_much_to_say_is_told(bit_rate: int | None) -> None:
    wire, frame = Wire(bit_rate), Frame(0x181, b"")
    wire.offer("node", frame, 0.0)
    assert wire.waiting("node") == 1
    assert not wire.full("node")
    for _ in range(10_000):
        wire.offer("node", frame, 0.0)
    assert wire.full("node")
    assert wire.full("other") is (bit_rate is None), "where frames take no time there is one queue"
    while wire.take(1e6) is not None:
        pass
    assert wire.waiting("node") == 0
    assert not wire.full("node")

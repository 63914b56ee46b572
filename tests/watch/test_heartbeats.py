"""A heartbeat is due by the node's 0x1017 as it is now, whoever wrote it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.network.check.network_rules import network_findings
from dvtcli.domain.ports import Frame
from dvtcli.watch.decoder import Decoder
from dvtcli.watch.heartbeats import GRACE_S, MISSING_AFTER_PERIODS, Heartbeats
from dvtcli.watch.seen import FrameStore
from dvtcli.watch.statistics import GRACE_S as ROW_GRACE_S
from tests.domain.network_check.planted import SOUND, CheckedNetwork, hears

NODE = 5
BEGIN_S = 100.0
STEP_S = 0.02


def request(data: str) -> Frame:
    return Frame(0x600 + NODE, bytes.fromhex(data))


def answer(data: str) -> Frame:
    return Frame(0x580 + NODE, bytes.fromhex(data))


def word(number: int) -> str:
    return number.to_bytes(2, "little").hex()


#: how 0x1017 may be written: expedited with and without its length, in segments
WRITES = {
    "expedited": lambda ms: [request(f"2B171000{word(ms)}0000"), answer("6017100000000000")],
    "without a length": lambda ms: [request(f"22171000{word(ms)}0000"), answer("6017100000000000")],
    "segmented": lambda ms: [
        request("2117100002000000"), answer("6017100000000000"), request(f"0B{word(ms)}0000000000"),
        answer("2000000000000000"),
    ],
}  # fmt: skip
REFUSED = [request("2B171000E8030000"), answer("8017100022000008")]


def beats(begin_s: float, end_s: float, period_s: float) -> Iterator[tuple[float, Frame]]:
    at_s = begin_s
    while at_s < end_s:
        yield at_s, Frame(0x700 + NODE, b"\x05", timestamp_s=at_s)
        at_s += period_s


def happens(old_ms: int, new_ms: int, write: list[Frame]) -> tuple[list[tuple[float, Frame]], float]:
    """Ten heartbeats by *old_ms*, the frames of a *write*, then ten by *new_ms*; and when the last one comes."""
    written_s = BEGIN_S + 9.5 * old_ms / 1000
    end_s = written_s + 10.5 * new_ms / 1000
    frames = [*beats(BEGIN_S, written_s, old_ms / 1000), *((written_s, frame) for frame in write)]
    frames += beats(written_s + new_ms / 1000, end_s, new_ms / 1000)
    return [(at_s, Frame(one.can_id, one.data, timestamp_s=at_s)) for at_s, one in frames], frames[-1][0]


PERIODS_MS = st.sampled_from([20, 100, 500, 1000, 4000, 30_000])


@given(PERIODS_MS, PERIODS_MS, st.sampled_from(sorted(WRITES)))
def test_nothing_is_missing_while_the_node_keeps_its_new_period(old_ms: int, new_ms: int, how: str) -> None:
    heartbeats, store = Heartbeats(), FrameStore(Decoder())
    frames, last_s = happens(old_ms, new_ms, WRITES[how](new_ms))
    later_s = [*(at_s for at_s, _ in frames[1:]), last_s]
    for (at_s, frame), next_s in zip(frames, later_s, strict=True):
        heartbeats.take(frame, at_s)
        store.take(frame)
        just_before_s = max(at_s, next_s - 0.001)
        silence = heartbeats.silence_s(NODE, just_before_s)
        assert silence is None or not silence[1], f"{silence} at {just_before_s}"
        assert store.rows[0x700 + NODE, False].rhythm.rate_hz(just_before_s) != 0.0
    gone_s = last_s + MISSING_AFTER_PERIODS * new_ms / 1000 + GRACE_S + ROW_GRACE_S
    silence = heartbeats.silence_s(NODE, gone_s)
    assert silence is not None
    assert silence[1], "a node that is gone is missed by the new period"


@given(PERIODS_MS)
def test_a_write_that_the_node_refused_changes_nothing(old_ms: int) -> None:
    heartbeats = Heartbeats()
    for at_s, frame in [*beats(BEGIN_S, BEGIN_S + 5 * old_ms / 1000, old_ms / 1000)]:
        heartbeats.take(frame, at_s)
    for frame in REFUSED:
        heartbeats.take(frame, at_s)
    late_s = at_s + MISSING_AFTER_PERIODS * old_ms / 1000 + GRACE_S
    before, after = heartbeats.silence_s(NODE, late_s - 0.01), heartbeats.silence_s(NODE, late_s + 0.01)
    assert (before and before[1], after and after[1]) == (False, True)


def test_a_node_that_was_told_to_send_none_is_not_missed() -> None:
    heartbeats = Heartbeats()
    for at_s, frame in beats(BEGIN_S, BEGIN_S + 1, 0.1):
        heartbeats.take(frame, at_s)
    for frame in WRITES["expedited"](0):
        heartbeats.take(frame, BEGIN_S + 1)
    assert heartbeats.silence_s(NODE, BEGIN_S + 60) is None


def test_a_restart_ends_what_was_written_and_not_stored() -> None:
    heartbeats = Heartbeats()
    for frame in WRITES["expedited"](30_000):
        heartbeats.take(frame, BEGIN_S)
    heartbeats.take(Frame(0x700 + NODE, b"\0"), BEGIN_S + 1)
    for at_s, frame in beats(BEGIN_S + 1.1, BEGIN_S + 2, 0.1):
        heartbeats.take(frame, at_s)
    silence = heartbeats.silence_s(NODE, BEGIN_S + 4)
    assert silence is not None
    assert silence[1], "by its own 100 ms, not by 30 s"


def test_what_is_read_of_it_counts_as_well() -> None:
    heartbeats = Heartbeats()
    for at_s, frame in beats(BEGIN_S, BEGIN_S + 0.3, 0.1):
        heartbeats.take(frame, at_s)
    heartbeats.take(request("4017100000000000"), BEGIN_S + 0.3)
    heartbeats.take(answer(f"4B171000{word(5000)}0000"), BEGIN_S + 0.3)
    silence = heartbeats.silence_s(NODE, BEGIN_S + 8)
    assert silence is not None
    assert not silence[1]


@pytest.mark.parametrize("how", sorted(set(WRITES) - {"segmented"}))
def test_check_says_nothing_of_a_period_that_was_written_while_it_listened(how: str) -> None:
    fast = [Frame(0x705, b"\x05", timestamp_s=1 + number / 50) for number in range(100)]
    write = [Frame(one.can_id, one.data, timestamp_s=3) for one in WRITES[how](500)[:1]]
    for frames, without, rule in ((fast, None, "node-id-twice"), ([], 0x705, "heartbeat-not-heard")):
        before = CheckedNetwork(SOUND, 500_000, hears(*frames, without=without)())
        after = CheckedNetwork(SOUND, 500_000, hears(*frames, *write, without=without)())
        assert list(network_findings(before, {rule})), "what is to be found without a write"
        assert not list(network_findings(after, {rule}))

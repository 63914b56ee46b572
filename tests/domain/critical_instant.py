"""Worst-case response times by sending frame by frame: what `domain.network.response_time` is held against.

Written apart from it: no recurrence, a wire on which the longest frame of lower priority has just begun when all others
become ready, each as late as its jitter allows the first time and as early as it can from then on.
"""

from __future__ import annotations

from fractions import Fraction

#: Priority (lower goes first), bits, period and jitter in µs.
Row = tuple[int, int, Fraction | int | None, Fraction | int]


def by_hand(rows: list[Row], bit_rate: int, blocking_bits: int) -> list[Fraction | None]:
    """The longest that each of *rows* takes, in µs."""
    return [_longest(row, rows, bit_rate, blocking_bits) for row in rows]


def _longest(own: Row, rows: list[Row], bit_rate: int, blocking_bits: int) -> Fraction | None:
    bit_us = Fraction(1_000_000, bit_rate)
    higher = [row for row in rows if row[0] < own[0]]
    share = sum((row[1] * bit_us / Fraction(row[2] or 1) for row in [*higher, own]), Fraction(0))
    if share >= 1:
        return None
    blocked = max([blocking_bits, *(row[1] for row in rows if row[0] > own[0])]) * bit_us
    worst = Fraction(0)
    for number in range(_count_in_busy_period([*higher, own], blocked, bit_us)):
        begins = _begins(own, number, higher, blocked, bit_us)
        should_us = number * Fraction(own[2] or 1) - Fraction(own[3])
        worst = max(worst, begins + own[1] * bit_us - should_us)
    return worst


def _ready(row: Row, number: int) -> Fraction:
    """When the instance *number* of *row* is ready at the earliest, seen from the critical instant."""
    return max(Fraction(0), number * Fraction(row[2] or 1) - Fraction(row[3]))


def _begins(own: Row, number: int, higher: list[Row], now_us: Fraction, bit_us: Fraction) -> Fraction:
    """When instance *number* of *own* begins to travel: whatever is ready within the first bit still goes first."""
    sent = dict.fromkeys(range(len(higher)), 0)
    before = 0
    while True:
        ahead = next((at for at, row in enumerate(higher) if _ready(row, sent[at]) < now_us + bit_us), None)
        if ahead is not None:
            sent[ahead] += 1
            now_us += higher[ahead][1] * bit_us
        elif before < number:
            before += 1
            now_us += own[1] * bit_us
        else:
            return now_us


def _count_in_busy_period(rows: list[Row], now_us: Fraction, bit_us: Fraction) -> int:
    """How many instances of the last of *rows* are sent until none of them waits any more."""
    sent = [0] * len(rows)
    first = True
    while True:
        ahead = next((at for at, row in enumerate(rows) if first or _ready(row, sent[at]) < now_us), None)
        if first:
            ahead, first = len(rows) - 1, False
        if ahead is None:
            return sent[-1]
        sent[ahead] += 1
        now_us += rows[ahead][1] * bit_us

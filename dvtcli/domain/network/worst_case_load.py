"""Worst-case bus load of a network's frames, and whether each frame meets its deadline. Pure computation."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

from dvtcli.domain.frame_bits import least_frame_bits, most_frame_bits
from dvtcli.domain.network.frame_streams import Stream, Streams
from dvtcli.domain.response_time import response_times, utilisation

#: The longest SDO frame: without period, and of lowest priority.
SDO_BITS = most_frame_bits(8)
#: The bit rates of CiA 301, in bit/s.
BIT_RATES = (10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
_SETTLES = 8


@dataclass(frozen=True, slots=True)
class StreamLoad:
    """A *stream* on the bus: its *share* (0 and up), and its worst-case response time (*response_us*).

    Both are None if unbounded.
    """

    stream: Stream
    share: Fraction | None
    response_us: Fraction | None

    @property
    def is_late(self) -> bool:
        """Whether the frame may miss its deadline; also if its response time is unbounded."""
        deadline = self.stream.deadline_us
        return deadline is not None and (self.response_us is None or self.response_us > deadline)

    @property
    def least_share(self) -> Fraction | None:
        """The share without stuff bits."""
        frame = self.stream.frame
        if self.share is None:
            return None
        return (
            self.share * least_frame_bits(frame.data_bytes, extended=frame.extended, remote=frame.remote) / frame.bits
        )


@dataclass(frozen=True, slots=True)
class WorstCaseLoad:
    """The load by all streams at *bit_rate* bit/s, by priority; *assumed* are the assumptions."""

    bit_rate: int
    needs: tuple[StreamLoad, ...]
    assumed: tuple[str, ...] = ()

    @property
    def limited(self) -> Fraction:
        """The share of all bounded streams."""
        return sum((need.share for need in self.needs if need.share is not None), Fraction(0))

    @property
    def least(self) -> Fraction:
        """The share of all bounded streams without stuff bits."""
        return sum((need.least_share for need in self.needs if need.least_share is not None), Fraction(0))

    @property
    def unlimited(self) -> tuple[Stream, ...]:
        """Streams without a frequency limit."""
        return tuple(need.stream for need in self.needs if need.share is None)

    @property
    def total(self) -> Fraction | None:
        """The worst-case load (0 and up); None if any stream is unbounded."""
        return None if self.unlimited else self.limited

    @property
    def late(self) -> tuple[StreamLoad, ...]:
        """Streams that may miss their deadline."""
        return tuple(need for need in self.needs if need.is_late)

    @property
    def fits(self) -> bool:
        """Whether all deadlines are met."""
        return not self.unlimited and not self.late


def worst_case_load(found: Streams, bit_rate: int) -> WorstCaseLoad:
    """The worst-case load of a bus by the streams *found* at *bit_rate* bit/s.

    Synchronous frames inherit SYNC's jitter: its delay beyond the shortest time on the wire.
    """
    streams = sorted(found.streams, key=lambda stream: stream.frame.arbitration)
    times = _times(streams, bit_rate)
    for _ in range(_SETTLES):
        late_us = _sync_jitter(streams, times, bit_rate)
        if late_us is None or all(stream.frame.jitter_us == late_us for stream in streams if stream.is_synchronous):
            break
        streams = [stream.late(late_us) if stream.is_synchronous else stream for stream in streams]
        times = _times(streams, bit_rate)
    shares = [None if stream.frame.period_us is None else utilisation([stream.frame], bit_rate) for stream in streams]
    needs = [StreamLoad(*row) for row in zip(streams, shares, times, strict=True)]
    return WorstCaseLoad(bit_rate, tuple(needs), found.assumed)


def _times(streams: list[Stream], bit_rate: int) -> list[Fraction | None]:
    return response_times([stream.frame for stream in streams], bit_rate, SDO_BITS)


def _sync_jitter(streams: list[Stream], times: list[Fraction | None], bit_rate: int) -> Fraction | None:
    """Jitter of SYNC in µs: latest minus earliest reception; None without SYNC, or if unbounded."""
    late = [
        time - Fraction(1_000_000 * least_frame_bits(one.frame.data_bytes, extended=one.frame.extended), bit_rate)
        for one, time in zip(streams, times, strict=True)
        if one.kind == "sync" and time is not None
    ]
    return max(late, default=None)


def fitting_bit_rates(found: Streams) -> tuple[int, ...]:
    """CiA 301 bit rates at which all *found* streams meet their deadlines."""
    return tuple(rate for rate in BIT_RATES if worst_case_load(found, rate).fits)


#: How far the clocks of two devices, and when frames come to be counted, may be apart; and frames beyond what a period
#: has room for: the first, and one that was late before it.
_CLOCKS, _AT_ENDS = 1.05, 2


def most_frames(streams: Iterable[Stream], seconds: float) -> int | None:
    """Maximum number of frames of *streams* within *seconds*; None if a stream is unbounded."""
    most = 0
    for stream in streams:
        if not stream.frame.period_us:
            return None
        most += int(_CLOCKS * seconds * 1_000_000 / stream.frame.period_us) + _AT_ENDS
    return most

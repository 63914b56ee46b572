"""Calendar times as text, and times in milliseconds as counts of communication parameters."""

from __future__ import annotations

import re
import time
from datetime import UTC, datetime, timedelta, timezone
from datetime import time as time_of_day
from functools import lru_cache
from math import modf

#: how much of `.075123` a text has, by the names of `datetime.isoformat`
_FRACTION = {"seconds": 0, "milliseconds": 4, "microseconds": 7}


def utc(time_s: float) -> str:
    """A time (s since 1970) as RFC 3339 in UTC, with microseconds."""
    second, microseconds = _split(time_s)
    return f"{_utc_second(second)}.{microseconds:06d}Z"


def local_clock(time_s: float, timespec: str = "seconds") -> str:
    """A time (s since 1970) as the local time of day with its offset, `14:03:05.075+01:00`.

    *timespec* is as in `datetime.isoformat`. Without the date: for current events, or events that follow another.
    """
    second, microseconds = _split(time_s)
    clock, offset = _local_second(second, time.tzname, time.timezone)
    return f"{clock}{f'.{microseconds:06d}'[: _FRACTION[timespec]]}{offset}"


def _split(time_s: float) -> tuple[int, int]:
    """Whole seconds and microseconds of a time, rounded like `datetime.fromtimestamp`."""
    if time_s >= 0:
        second = int(time_s)
        microseconds = round((time_s - second) * 1e6)
        if microseconds < 1_000_000:
            return second, microseconds
    part, whole = modf(time_s)
    carried, microseconds = divmod(round(part * 1e6), 1_000_000)
    return int(whole) + carried, microseconds


@lru_cache(maxsize=64)
def _utc_second(second: int) -> str:
    return datetime.fromtimestamp(second, UTC).replace(tzinfo=None).isoformat()


@lru_cache(maxsize=64)
def _local_second(second: int, _names: tuple[str, str], _west_s: int) -> tuple[str, str]:
    """A whole second as the local time of day, and its offset, in the zone of those names and seconds west of UTC."""
    clock = time.localtime(second)
    return f"{clock.tm_hour:02d}:{clock.tm_min:02d}:{clock.tm_sec:02d}", _offset(clock.tm_gmtoff)


@lru_cache(maxsize=64)
def _offset(seconds: int) -> str:
    """An offset from UTC (s) as text: `+01:00`."""
    return time_of_day(tzinfo=timezone(timedelta(seconds=seconds))).isoformat().removeprefix("00:00:00")


_TIME = re.compile(r"([+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?) ?(ms|s|)")


def milliseconds(text: str) -> float:
    """The time *text*, `20`, `20ms` or `0.02 s`, in milliseconds. Raises ValueError if it is not a time."""
    found = _TIME.fullmatch(text.strip())
    if found is None:
        raise ValueError(f"{text!r} is not a time in milliseconds, such as 20, 20ms or 0.02s")
    return float(found[1]) * (1000 if found[2] == "s" else 1)


def counts(time_ms: float, unit_us: int, most: int = 0xFFFF) -> int:
    """*time_ms* as counts of *unit_us* µs. Raises ValueError if not a whole number, or above *most*."""
    number = time_ms * 1000 / unit_us
    top = most * unit_us / 1000
    if not 0 <= number <= most:
        raise ValueError(f"{time_ms:g} ms is not within 0…{top:g} ms")
    if abs(number - round(number)) > 1e-6:
        raise ValueError(f"{time_ms:g} ms is not a multiple of {unit_us / 1000:g} ms (counts of {unit_us} us)")
    return round(number)

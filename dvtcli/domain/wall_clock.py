"""Times of the calendar as text. Does not know where a time comes from."""

from __future__ import annotations

from datetime import UTC, datetime


def utc(time_s: float) -> str:
    """A time (s since 1970) as RFC 3339 in UTC, with microseconds."""
    return datetime.fromtimestamp(time_s, UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")


def local_clock(time_s: float, timespec: str = "seconds") -> str:
    """A time (s since 1970) as people read it: the local time of day with its offset, `14:03:05.075+01:00`.

    *timespec* is as of `datetime.isoformat`. Without the day: for what happens now, or follows another.
    """
    return datetime.fromtimestamp(time_s, UTC).astimezone().timetz().isoformat(timespec=timespec)

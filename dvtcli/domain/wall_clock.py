"""Times of the calendar as text. Does not know where a time comes from."""

from __future__ import annotations

from datetime import UTC, datetime


def utc(time_s: float) -> str:
    """A time (s since 1970) as RFC 3339 in UTC, with microseconds."""
    return datetime.fromtimestamp(time_s, UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")

"""Limits of values, as far as a file states sane ones. Does not know any object's meaning."""

from __future__ import annotations

from dvtcli.domain.abort import Abort
from dvtcli.domain.datatypes import Kind
from dvtcli.domain.object_dictionary import OdEntry
from dvtcli.simulator.refusal import Refusal


def check_limits(entry: OdEntry, data: bytes) -> None:
    """Raise Refusal(06090031) above, Refusal(06090032) below the limits of the file that describes *entry*.

    Limits count only where they make sense: low ≤ high, both within the type.
    """
    data_type = entry.data_type
    if data_type is None or data_type.kind not in (Kind.INTEGER, Kind.UNSIGNED, Kind.BOOLEAN, Kind.REAL):
        return
    low, high = entry.low, entry.high
    value = data_type.decode(data)
    assert isinstance(value, int | float)  # noqa: S101 - narrows the type; the kinds above decode to numbers
    floor, ceiling = data_type.limits or (float("-inf"), float("inf"))
    lowest = floor if low is None else low
    highest = ceiling if high is None else high
    if not floor <= lowest <= highest <= ceiling:
        return
    if value > highest:
        raise Refusal(Abort.VALUE_HIGH)
    if value < lowest:
        raise Refusal(Abort.VALUE_LOW)

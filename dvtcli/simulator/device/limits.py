"""Limits of values, as far as a file states sane ones. Does not know any object's meaning."""

from __future__ import annotations

from dvtcli.domain.abort import Abort
from dvtcli.domain.object_dictionary import OdEntry
from dvtcli.domain.pdo import Pdo
from dvtcli.simulator.device.refusal import Refusal


def check_limits(entry: OdEntry, node_id: int, data: bytes) -> None:
    """Raise Refusal(06090031) above, Refusal(06090032) below the limits of the file that describes *entry*.

    Limits count only where they make sense: low ≤ high, both within the type; those of a PDO's parameter leave a
    choice, or it could not be configured at all (real files have 0..0 there).
    """
    data_type = entry.data_type
    value = None if data_type is None else data_type.decode(data)
    if data_type is None or not isinstance(value, int | float):
        return
    low, high = entry.limits(node_id)
    floor, ceiling = data_type.limits or (float("-inf"), float("inf"))
    lowest = floor if low is None else low
    highest = ceiling if high is None else high
    if not floor <= lowest <= highest <= ceiling or (lowest == highest and Pdo.at(entry.index)):
        return
    if value > highest:
        raise Refusal(Abort.VALUE_HIGH)
    if value < lowest:
        raise Refusal(Abort.VALUE_LOW)

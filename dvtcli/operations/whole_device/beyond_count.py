"""Entries of a PDO mapping beyond its count: they map nothing, whatever they hold. Reads no device and no file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from dvtcli.domain.standard_objects import is_pdo_mapping

if TYPE_CHECKING:
    from dvtcli.domain.profile import ObjectAddress
    from dvtcli.files.whole_device_file import KeptObject

Objects = Mapping["ObjectAddress", "KeptObject"]


def count_beneath(place: ObjectAddress, *sides: Objects) -> int | None:
    """The count of the PDO mapping whose entry *place* is beyond it on all *sides*; None where it is not.

    A side that says no count has the others'. Where they say several it is the highest.
    """
    index, sub_index = place
    if not is_pdo_mapping(index) or not sub_index:
        return None
    counts = [data for side in sides if (data := _data(side, (index, 0))) is not None]
    if not counts or not all(len(data) == 1 and data[0] < sub_index for data in counts):
        return None
    return max(data[0] for data in counts)


def wants_more(place: ObjectAddress, side: Objects) -> bool:
    """Whether *side* says of the mapping entry *place* that it maps something (0 is nothing), and says no count."""
    return _data(side, (place[0], 0)) is None and any(_data(side, place) or b"")


def _data(side: Objects, place: ObjectAddress) -> bytes | None:
    kept = side.get(place)
    return None if kept is None else kept.data

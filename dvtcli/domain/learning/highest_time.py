"""The search for the highest time that a device takes: which is asked next. Pure; asks nobody."""

from __future__ import annotations

from collections.abc import Mapping

from dvtcli.domain.learning.probe import ProbeAnswer

#: An event timer and an inhibit time that no device refuses for its size.
_SHORT = 10


def next_time(answers: Mapping[str, ProbeAnswer], name: str) -> int | None:
    """The time that is to be asked next; None where the highest is known, or cannot be found."""
    values = {
        int(one.rpartition(" ")[2]): answer
        for one, answer in answers.items()
        if one.startswith(f"{name} ") and one.rpartition(" ")[2].isdecimal()
    }
    if any(answer.code is None for answer in values.values()):
        return None
    taken = max((value for value, answer in values.items() if answer.kept), default=-1)
    above = min((value for value, answer in values.items() if value > taken and not answer.kept), default=None)
    if above is None:
        return None if taken == 0xFFFF else 0xFFFF
    if taken < 0:
        return _SHORT if _SHORT not in values else None
    if above - taken <= 1:
        return None
    return 0x7FFF if 0x7FFF not in values and taken < 0x7FFF < above else (taken + above) // 2

"""What a device's answers mean for the tool: values of a profile that no simulated family has. Pure; asks nobody."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from dvtcli.domain.learning.learnt_value import Learnt
from dvtcli.domain.learning.probe_table import TYPES, KnownAnswers
from dvtcli.domain.learning.summaries import access_answer, highest_time, types_taken
from dvtcli.domain.pdo import Direction


def profile_values(known: Mapping[Direction, KnownAnswers]) -> Iterator[Learnt]:
    """What only the tool must know."""
    tpdo, rpdo = known.get(Direction.TPDO), known.get(Direction.RPDO)
    if tpdo is not None:
        ranges = [(first, last) for first, last, code in types_taken(tpdo) if not code]
        if ranges:
            evidence = "; ".join(
                tpdo.answers[f"type {value}"].text for value in TYPES if f"type {value}" in tpdo.answers
            )
            yield Learnt("transmission_types", [[first, last] for first, last in _joined(ranges)], evidence)
    for way, key, access in ((tpdo, "rw_in_tpdo", "rw"), (tpdo, "rww_in_tpdo", "rww"), (rpdo, "rw_in_rpdo", "rw")):
        answer = None if way is None else access_answer(way, access)
        if answer is not None:
            yield Learnt(key, "fine" if answer.accepted else "error", answer.text)
    times = [
        (highest, text)
        for answers in known.values()
        for name in ("inhibit time", "event timer")
        if (found := highest_time(answers, name)) is not None
        for highest, text in [found]
    ]
    if times:
        highest, text = min(times)
        yield Learnt("max_time_count", highest, text)


def _joined(ranges: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """*ranges* in order, with those that touch made one."""
    joined: list[tuple[int, int]] = []
    for first, last in ranges:
        if joined and joined[-1][1] + 1 == first:
            joined[-1] = (joined[-1][0], last)
        else:
            joined.append((first, last))
    return joined

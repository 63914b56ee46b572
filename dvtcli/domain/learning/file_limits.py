"""Probe values outside a file's limits for PDO parameters, and report accepted values.

Pure; sends nothing. The checks have the names of a simulated device's (`answers` of its family).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from dvtcli.domain.learning.probe import Probe, ProbeAnswer, ProbeWrite, Stand
from dvtcli.domain.pdo import is_mapping_index
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME, SYNC_START, TRANSMISSION_TYPE

if TYPE_CHECKING:
    from dvtcli.domain.learning.probe import ProbedPdo

#: Names of the parameters: in the check, and for people.
_CHECKED = {
    TRANSMISSION_TYPE: ("type", "transmission type"),
    INHIBIT_TIME: ("inhibit", "inhibit time"),
    EVENT_TIMER: ("event", "event timer"),
    SYNC_START: ("sync-start", "SYNC start value"),
}
_COB_ID = 1
#: Transmission types that need bit 30 clear: refused for another reason.
_ON_REQUEST = (252, 253)


def limit_probes(subject: ProbedPdo) -> Iterator[Probe]:
    """A value below and a value above each communication parameter's limits, if the type allows."""
    index = subject.pdo.communication_index
    for sub_index, data in subject.parameters.items():
        if (index, sub_index) not in subject.limits or sub_index not in _CHECKED:
            continue
        low, high = subject.limits[index, sub_index]
        check, what = _CHECKED[sub_index]
        for side, values in (("below", range(low - 1, low - 2, -1)), ("above", range(high + 1, high + 4))):
            value = next(
                (
                    candidate
                    for candidate in values
                    if 0 <= candidate < 1 << 8 * len(data) and not _rtr(sub_index, candidate)
                ),
                None,
            )
            if value is not None:
                write = ProbeWrite(index, sub_index, value.to_bytes(len(data), "little"))
                sense = f"{what} {value}, {side} the limit of the EDS, is taken"
                name = f"{what} {side} its limit"
                yield Probe(subject.pdo, name, sense, Stand.EMPTY, (write,), f"{check}-{side}-limit")


def _rtr(sub_index: int, value: int) -> bool:
    return sub_index == TRANSMISSION_TYPE and value in _ON_REQUEST


def taken_beyond(subject: ProbedPdo, answers: Iterable[ProbeAnswer]) -> Mapping[str, ProbeAnswer]:
    """The first answer per limit check that accepted a value outside the limits."""
    found: dict[str, ProbeAnswer] = {}
    for answer in answers:
        for write in answer.probe.writes if answer.accepted else ():
            low, high = subject.limits.get((write.index, write.sub_index), (0, 1 << 64))
            value = int.from_bytes(write.data, "little")
            name = _name(write)
            if name and not low <= value <= high:
                found.setdefault(f"{name}-{'below' if value < low else 'above'}-limit", answer)
    return found


def _name(write: ProbeWrite) -> str:
    if is_mapping_index(write.index):
        return "entry" if write.sub_index else "count"
    return "cob-id" if write.sub_index == _COB_ID else _CHECKED.get(write.sub_index, ("", ""))[0]

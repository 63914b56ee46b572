"""What `learn` would ask of a device, before anything is: for a dry run, and for how often it writes at most."""

from __future__ import annotations

from dvtcli.domain.learning.probe import ACCEPTED, Answer, Probe, Stand, Subject, Where
from dvtcli.domain.learning.probe_table import Known, next_probes

#: Downloads that bring a PDO from one probe to where the next one starts: off, count, what the probe had changed, then
#: an entry and its count, and on.
_ON_THE_WAY = {Stand.FOUND: 0, Stand.BACK: 0, Stand.EMPTY: 2, Stand.FILLED: 3, Stand.ON: 5}
#: Downloads of the search for the highest inhibit time and event timer: each halves what is left of 16 bits.
_SEARCHES = 2 * 18 * 2


def forecast(subject: Subject, *, isolated: bool) -> list[Probe]:
    """The probes that are made of *subject* where the device takes everything."""
    answers: dict[str, Answer] = {}
    known = Known(subject, answers)
    while probes := next_probes(known):
        for probe in probes:
            answers[probe.name] = Answer(probe, ACCEPTED, probe.asked.data)
    return [answer.probe for answer in answers.values() if isolated or answer.probe.where is not Where.ISOLATED]


def most_writes(subject: Subject, probes: list[Probe]) -> int:
    """How many downloads these are at most, refusals asked twice, with the way between them; in full fifties."""
    asked = sum(len(probe.writes) + 1 + _ON_THE_WAY[probe.stand] for probe in probes)
    around = 2 * (len(subject.entries) + len(subject.parameters)) + 4
    return -(-(asked + around + _SEARCHES) // 50) * 50

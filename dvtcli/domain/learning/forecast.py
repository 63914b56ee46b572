"""What `learn` would ask of a device, before anything is: for a dry run, and for how often it writes at most."""

from __future__ import annotations

from dvtcli.domain.learning.operational import while_operational
from dvtcli.domain.learning.probe import ACCEPTED, Probe, ProbeAnswer, ProbeCondition, ProbedPdo, Stand
from dvtcli.domain.learning.probe_table import KnownAnswers, next_probes
from dvtcli.domain.pdo import is_mapping_index
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME

#: Downloads that bring a PDO to where the first probe of a stand starts, and back to where each next one does after
#: one that was accepted: off, count 0, what was changed, the count, and on.
_FIRST = {Stand.FOUND: 0, Stand.BACK: 0, Stand.EMPTY: 2, Stand.FILLED: 2, Stand.ON: 1}
_BACK = {Stand.FOUND: 0, Stand.BACK: 0, Stand.EMPTY: 0, Stand.FILLED: 3, Stand.ON: 5}
#: Probes that the search for a highest time takes at most, besides the first: each halves what is left of 16 bits.
_SEARCH = 17
#: A refusal is asked twice; where one was accepted that is searched for, it is put back.
_TWICE = 2


def forecast(subject: ProbedPdo, *, isolated: bool, operational: bool = False) -> list[Probe]:
    """The probes that are made of *subject* where the device takes everything.

    *operational*: the node was found so, and is asked so, too.
    """
    first = while_operational(subject) if isolated and operational else []
    answers = {probe.name: ProbeAnswer(probe, ACCEPTED, probe.asked.data) for probe in first}
    known = KnownAnswers(subject, answers)
    while probes := next_probes(known):
        for probe in probes:
            answers[probe.name] = ProbeAnswer(probe, ACCEPTED, probe.asked.data)
    return [
        answer.probe for answer in answers.values() if isolated or answer.probe.where is not ProbeCondition.ISOLATED
    ]


def most_writes(subject: ProbedPdo, probes: list[Probe]) -> int:
    """How many downloads these are at most, refusals asked twice, with the way between them; in full tens."""
    asked = sum(len(probe.writes) - 1 + max(_TWICE, 1 + _way_back(probe)) for probe in probes)
    stands = sum(_FIRST[stand] for stand in {probe.stand for probe in probes})
    again = [len(probe.writes) + 1 for probe in probes if probe.where is ProbeCondition.OPERATIONAL]
    around = sum(again) + _TWICE * (len(subject.entries) + len(subject.parameters))
    searches = sum(sub_index in subject.parameters for sub_index in (INHIBIT_TIME, EVENT_TIMER))
    refused = len(subject.fits) + max(0, len(subject.entries) - 2)  # what is asked only where others were refused
    most = asked + stands + around + _TWICE * (searches * _SEARCH + refused)
    return -(-most // 10) * 10


def most_until_refused(subject: ProbedPdo) -> int:
    """How many downloads at most find out that the first entry of *subject* does not take back what it holds."""
    opening = 2  # off, count 0
    return _TWICE * (opening + len(subject.parameters) + 1)


def _way_back(probe: Probe) -> int:
    """How many downloads undo *probe* where it was accepted: entries of an open mapping may stay as they are."""
    entries = {write.sub_index for write in probe.writes if is_mapping_index(write.index) and write.sub_index}
    places = {(write.index, write.sub_index) for write in probe.writes}
    return _BACK[probe.stand] or len(places) - len(entries)

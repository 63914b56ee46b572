"""What several answers say together: which transmission types, the highest time, what is too long. Pure."""

from __future__ import annotations

from itertools import groupby

from dvtcli.domain.learning.probe import ProbeAnswer
from dvtcli.domain.learning.probe_table import TYPES, KnownAnswers
from dvtcli.domain.mapping import DUMMY_BITS


def longer_refused(known: KnownAnswers) -> list[ProbeAnswer]:
    """The refusals of objects that are longer than any that was taken, for nothing but that."""
    longest = max((fit.bits for fit in known.fits), default=64)
    refused = known.refused_for(known.length)
    return [answer for answer in refused if answer.probe.entry_bits > longest]


def access_answer(known: KnownAnswers, access: str) -> ProbeAnswer | None:
    """What the device answers to mappable objects with *access*: one that it took, else a refusal for that alone."""
    asked = {entry: answer for entry, answer in known.mapped.items() if known.access(entry) == access}
    taken = next((answer for answer in asked.values() if answer.accepted), None)
    if taken is not None:
        return taken
    refused = known.refused_for(known.access)
    return next((answer for answer in asked.values() if answer in refused), None)


def has_one_cause(known: KnownAnswers, answer: ProbeAnswer) -> bool:
    """Whether no length explains a refusal: one that was taken, as a whole object or as a dummy."""
    lengths = {fit.bits for fit in known.fits}
    lengths |= {bits for index, bits in DUMMY_BITS.items() if known.accepted(f"dummy {index}")}
    return answer.probe.entry_bits in lengths


def types_taken(known: KnownAnswers) -> list[tuple[int, int, int]]:
    """First and last transmission type, and abort code: between two that answer alike all do. Empty if one did not."""
    answers = [(value, known.answers.get(f"type {value}")) for value in TYPES]
    codes = [(value, answer.code) for value, answer in answers if answer is not None and answer.code is not None]
    if len(codes) < len(TYPES):
        return []
    found = []
    for code, group in groupby(codes, key=lambda pair: pair[1]):
        values = [value for value, _ in group]
        found.append((values[0], values[-1], code or 0))
    return [
        (first, last if n + 1 == len(found) else found[n + 1][0] - 1, code)
        for n, (first, last, code) in enumerate(found)
    ]


def highest_time(known: KnownAnswers, name: str) -> tuple[int, str] | None:
    """The highest time that was taken, and the evidence; None where none was asked."""
    asked = {
        int(one.rpartition(" ")[2]): answer
        for one, answer in known.answers.items()
        if one.startswith(f"{name} ") and one.rpartition(" ")[2].isdecimal()
    }
    taken = [value for value, answer in asked.items() if answer.kept]
    if not taken or any(answer.code is None for answer in asked.values()):
        return None
    refused = [value for value, answer in asked.items() if not answer.kept and value > max(taken)]
    return max(taken), asked[min(refused) if refused else max(taken)].text

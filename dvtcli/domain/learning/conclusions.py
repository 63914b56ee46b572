"""What a device's answers mean: values that a profile and a simulated family call the same. Pure; asks nobody."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from dvtcli.domain.learning.for_family import family_values
from dvtcli.domain.learning.for_profile import profile_values
from dvtcli.domain.learning.learnt_value import Conclusions, Learnt
from dvtcli.domain.learning.operational import gate_for_family, gate_for_profile, rules_of_operational
from dvtcli.domain.learning.probe_table import KnownAnswers
from dvtcli.domain.learning.summaries import longer_refused
from dvtcli.domain.mapping import DUMMY_BITS
from dvtcli.domain.pdo import Direction


def conclude(known: Mapping[Direction, KnownAnswers], most_entries: int) -> Conclusions:
    """What the answers of each direction mean; *most_entries* is how many the file gives the PDO that has most."""
    both = [*_common(known, most_entries)]
    each = {way: one.answers for way, one in known.items()}
    profile = [*both, *profile_values(known), *gate_for_profile(each.values())]
    family = [*both, *family_values(known), *gate_for_family(each)]
    return Conclusions(tuple(profile), tuple(rules_of_operational(family, each)))


def _common(known: Mapping[Direction, KnownAnswers], most_entries: int) -> Iterator[Learnt]:
    """What profile and family call the same."""
    each = list(known.values())
    yield from _max_entries(each, most_entries)
    yield from _max_entry_bits(each)
    yield from _first(_granularity(answers) for answers in each)
    policies = {way: found for way, answers in known.items() if (found := _rtr_bit(answers)) is not None}
    for way in Direction:
        if policies:
            yield policies.get(way) or Learnt(f"rtr_bit.{way}", "keep", "not asked: no PDO of this direction could be")
    yield from _first(_extended(answers) for answers in each)
    if Direction.RPDO in known:
        yield from _dummies(known[Direction.RPDO])


def _first(found: Iterable[Learnt | None]) -> Iterator[Learnt]:
    yield from [learnt for learnt in found if learnt is not None][:1]


def _max_entries(each: list[KnownAnswers], most_entries: int) -> Iterator[Learnt]:
    counted = [known for known in each if known.fits]
    if not counted:
        return
    most = max(counted, key=lambda known: known.max_entries)
    last = most.answers.get(f"entry {most.max_entries}") or next(a for a in most.answers.values() if a.accepted)
    if all(known.max_entries == len(known.subject.entries) for known in counted) and most_entries > most.max_entries:
        taken = f"{most.subject.pdo.label} took all {most.max_entries} that"
        evidence = (
            f"{taken} {'take back what they hold' if most.subject.more else 'it has'}, others have {most_entries}"
        )
        yield Learnt("max_entries", most_entries, evidence)
    elif not most.subject.more:
        yield Learnt("max_entries", most.max_entries, last.text)


def _max_entry_bits(each: Sequence[KnownAnswers]) -> Iterator[Learnt]:
    """The longest object that may be mapped, if a longer one was refused for nothing but its length.

    It was mapped in some direction; or its like was refused for something else, so that nothing is known against it.
    """
    longest = max((fit.bits for known in each for fit in known.fits), default=0)
    refused = [answer for known in each for answer in longer_refused(known) if answer.probe.entry_bits > longest]
    if longest and refused:
        first = min(refused, key=lambda answer: answer.probe.entry_bits)
        lengths = {entry.bits for known in each for entry in known.subject.objects}
        undecided = [bits for bits in lengths if longest < bits < first.probe.entry_bits]
        yield Learnt("max_entry_bits", max(undecided, default=longest), first.text)
    elif longest == 64:
        yield Learnt("max_entry_bits", 64, "no object was refused for its length")


def _granularity(known: KnownAnswers) -> Learnt | None:
    for bits in (1, 2, 4):
        if known.accepted(f"entry of {bits} bits"):
            return Learnt("granularity", bits, known.answers[f"entry of {bits} bits"].text)
    if any(fit.bits == 1 for fit in known.fits):
        return Learnt("granularity", 1, "an object of 1 bit was mapped")
    if known.accepted("entry-too-short") and known.refused("entry of 4 bits"):
        return Learnt("granularity", 8, known.answers["entry of 4 bits"].text)
    return None


def _rtr_bit(known: KnownAnswers) -> Learnt | None:
    clear, as_set = known.answers.get("bit 30 clear"), known.answers.get("bit 30 set")
    if clear is None or as_set is None or clear.code is None or as_set.code is None:
        return None
    if not (clear.accepted or as_set.accepted):
        return None  # it holds the bit one way or the other: something else was refused
    key = f"rtr_bit.{known.subject.pdo.direction}"
    if clear.accepted == as_set.accepted:
        return Learnt(key, "keep", f"{clear.text}; {as_set.text}")
    return Learnt(key, "clear", as_set.text) if clear.accepted else Learnt(key, "set", clear.text)


def _extended(known: KnownAnswers) -> Learnt | None:
    answer = known.answers.get("bit 29")
    return None if answer is None or answer.code is None else Learnt("extended_ids", answer.accepted, answer.text)


def _dummies(known: KnownAnswers) -> Iterator[Learnt]:
    answers = {index: known.answers.get(f"dummy {index}") for index in DUMMY_BITS}
    if any(answer is None or answer.code is None for answer in answers.values()):
        return
    taken = [index for index, answer in answers.items() if answer is not None and answer.accepted]
    texts = [answer.text for answer in answers.values() if answer is not None]
    yield Learnt("dummies", list(taken), texts[0] if len(taken) in (0, len(texts)) else "; ".join(texts))

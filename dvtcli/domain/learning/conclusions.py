"""Conclusions from a device's answers, as values for a profile and a simulated family. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby

from dvtcli.domain.learning.probe import (
    ACCEPTED,
    Conclusions,
    Learnt,
    Probe,
    ProbeAnswer,
    ProbeCondition,
    ProbedPdo,
    Stand,
    gate_for_family,
    gate_for_profile,
    rules_of_operational,
    while_operational,
)
from dvtcli.domain.learning.probe_table import AGAIN, OTHER_WAY, RESTRICTED, TYPES, KnownAnswers, next_probes
from dvtcli.domain.learning.read_dictionary import taken_beyond
from dvtcli.domain.pdo import DUMMY_BITS, Direction, is_mapping_index
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME

#: Downloads that bring a PDO to where the first probe of a stand starts, and back to where each next one does after
#: one that was accepted: off, count 0, what was changed, the count, and on.
_FIRST = {Stand.FOUND: 0, Stand.BACK: 0, Stand.EMPTY: 2, Stand.FILLED: 2, Stand.ON: 1}
_BACK = {Stand.FOUND: 0, Stand.BACK: 0, Stand.EMPTY: 0, Stand.FILLED: 3, Stand.ON: 5}
#: Maximum probes in the search for a highest time, besides the first: each halves the rest of 16 bits.
_SEARCH = 17
#: A refusal is probed twice; an accepted probe among them is rolled back.
_TWICE = 2


def forecast(subject: ProbedPdo, *, isolated: bool, operational: bool = False) -> list[Probe]:
    """The probes of *subject* if the device accepts everything.

    *operational*: the node was found OPERATIONAL, and is probed in this state too.
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
    """Maximum downloads for these probes, with repeated refusals and the way between probes; rounded up to tens."""
    asked = sum(len(probe.writes) - 1 + max(_TWICE, 1 + _way_back(probe)) for probe in probes)
    stands = sum(_FIRST[stand] for stand in {probe.stand for probe in probes})
    again = [len(probe.writes) + 1 for probe in probes if probe.where is ProbeCondition.OPERATIONAL]
    around = sum(again) + _TWICE * (len(subject.entries) + len(subject.parameters))
    searches = sum(sub_index in subject.parameters for sub_index in (INHIBIT_TIME, EVENT_TIMER))
    refused = len(subject.fits) + max(0, len(subject.entries) - 2)  # probed only after other refusals
    most = asked + stands + around + _TWICE * (searches * _SEARCH + refused)
    return -(-most // 10) * 10


def most_until_refused(subject: ProbedPdo) -> int:
    """Maximum downloads to find out that the first entry of *subject* refuses its old value."""
    opening = 2  # off, count 0
    return _TWICE * (opening + len(subject.parameters) + 1)


def _way_back(probe: Probe) -> int:
    """Maximum downloads to roll *probe* back if accepted: entries of an open mapping may stay as they are."""
    entries = {write.sub_index for write in probe.writes if is_mapping_index(write.index) and write.sub_index}
    places = {(write.index, write.sub_index) for write in probe.writes}
    return _BACK[probe.stand] or len(places) - len(entries)


def longer_refused(known: KnownAnswers) -> list[ProbeAnswer]:
    """Refusals caused only by an object length above the longest accepted length."""
    longest = max((fit.bits for fit in known.fits), default=64)
    refused = known.refused_for(known.length)
    return [answer for answer in refused if answer.probe.entry_bits > longest]


def access_answer(known: KnownAnswers, access: str) -> ProbeAnswer | None:
    """Answer to mappable objects with *access*: an accepted probe, else a refusal caused by the access alone."""
    asked = {entry: answer for entry, answer in known.mapped.items() if known.access(entry) == access}
    taken = next((answer for answer in asked.values() if answer.accepted), None)
    if taken is not None:
        return taken
    refused = known.refused_for(known.access)
    return next((answer for answer in asked.values() if answer in refused), None)


def has_one_cause(known: KnownAnswers, answer: ProbeAnswer) -> bool:
    """Whether length does not explain a refusal: the length was accepted, for a whole object or a dummy."""
    lengths = {fit.bits for fit in known.fits}
    lengths |= {bits for index, bits in DUMMY_BITS.items() if known.accepted(f"dummy {index}")}
    return answer.probe.entry_bits in lengths


def types_taken(known: KnownAnswers) -> list[tuple[int, int, int]]:
    """First and last transmission type and abort code of ranges with equal answers. Empty if an answer is missing."""
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
    """The highest accepted time, and the evidence; None if no time was probed."""
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


#: Checks with a single probe of the same name: acceptance proves as much as an abort code.
_PLAIN = frozenset(
    {
        "not-mappable", "missing-object", "missing-sub-index", "entry-zero", "entry-too-long", "entry-too-short",
        "count-beyond", "count-over-zero", "count-over-no-bits", "too-many-bits", "entry-again-counted",
        "entry-while-counted", "type-without-rtr", "empty-enabled", "cob-id-again", "cob-id-while-valid", "count-again",
        "count-while-valid", "entry-again", "entry-while-valid", "type-while-valid", "inhibit-while-valid",
        "event-while-valid", "sync-start-while-valid", "beyond-frame", "dummy-sub-index",
        *(f"{name}-{side}-limit" for name in ("type", "inhibit", "event", "sync-start") for side in ("below", "above")),
    }
)  # fmt: skip
#: Checks whose code follows from one refusal, whatever else is accepted.
_FIRST_REFUSED = frozenset(
    {"granularity", "dummy", "rtr-bit", "extended", "inhibit-high", "event-high", "restricted", "no-entry"}
)

#: Checks whose refusal proves nothing if the entry's length explains it.
_BY_LENGTH = frozenset({"not-mappable", "missing-object", "entry-too-long", "dummy"})


def family_values(known: Mapping[Direction, KnownAnswers]) -> Iterator[Learnt]:
    """How a simulated device answers the same."""
    yield from _family_types(known)
    yield from _accesses(known)
    for name, key in (("inhibit time", "max_inhibit_time"), ("event timer", "max_event_timer")):
        found = [highest for answers in known.values() if (highest := highest_time(answers, name)) is not None]
        if found:
            value, text = max(found)
            yield Learnt(key, value, text)
    restricted = [answer for answers in known.values() for answer in _restricted(answers)]
    if restricted:
        refused = [answer for answer in restricted if answer.code]
        yield Learnt("restricted_ids_refused", bool(refused), (refused or restricted)[0].text)
    if Direction.TPDO in known:
        yield from _tpdo_dummies(known[Direction.TPDO])
    for way in Direction:
        yield from _answers(way, known[way]) if way in known else ()


def _family_types(known: Mapping[Direction, KnownAnswers]) -> Iterator[Learnt]:
    for way, one in known.items():
        ranges = types_taken(one)
        if ranges:
            evidence = "; ".join(one.answers[f"type {value}"].text for value in TYPES)
            yield Learnt(f"pdo_types.{way}", [list(each) for each in ranges], evidence)


def _accesses(known: Mapping[Direction, KnownAnswers]) -> Iterator[Learnt]:
    for way, one in known.items():
        asked = [name.removeprefix("access ") for name, a in one.answers.items() if name.startswith("access ")]
        answers = {access: answer for access in asked if AGAIN not in access and (answer := access_answer(one, access))}
        if answers and len(answers) == sum(AGAIN not in access for access in asked):
            taken = [access for access, answer in answers.items() if answer.accepted]
            evidence = "; ".join(f"{access}: {answer.text}" for access, answer in answers.items())
            yield Learnt(f"{way}_access", list(taken), evidence)


def _restricted(known: KnownAnswers) -> list[ProbeAnswer]:
    found = (known.answers.get(f"CAN-ID 0x{can_id:03X}") for can_id in RESTRICTED)
    return [answer for answer in found if answer is not None and answer.code is not None]


def _tpdo_dummies(known: KnownAnswers) -> Iterator[Learnt]:
    answers = [answer for index in DUMMY_BITS if (answer := known.answers.get(f"dummy {index}")) is not None]
    codes = {answer.code for answer in answers}
    if len(codes) == 1 and (code := codes.pop()) is not None:
        yield Learnt("tpdo_dummies", code, answers[0].text)
    elif 0 in codes:
        yield Learnt("tpdo_dummies", 0, next(answer for answer in answers if answer.accepted).text)


def _answers(way: Direction, known: KnownAnswers) -> Iterator[Learnt]:
    """The abort code of each check, 0 for accepted."""
    found: dict[str, ProbeAnswer] = {}
    for answer in known.answers.values():
        check = answer.probe.check
        if answer.code is None or check in found:
            continue
        if answer.code and check in _BY_LENGTH and not has_one_cause(known, answer):
            continue
        if check in _PLAIN or (check in _FIRST_REFUSED and answer.code):
            found[check] = answer
    longer = longer_refused(known)
    if longer:
        found["entry-bits"] = longer[0]
    elif (answer_72 := known.answers.get("entry of 72 bits")) is not None and known.accepted("entry-too-long"):
        found["entry-bits"] = answer_72
    wrong = [
        *known.refused_for(known.access),
        *(a for name, a in known.answers.items() if name == OTHER_WAY and a.code),
    ]
    if wrong:
        found["wrong-direction"] = wrong[0]
    found |= taken_beyond(known.subject, known.answers.values())
    for check, answer in found.items():
        if answer.code is not None:
            yield Learnt(f"answers.{way}.{check}", answer.code, answer.text)


def profile_values(known: Mapping[Direction, KnownAnswers]) -> Iterator[Learnt]:
    """Values for the profile only."""
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
    """*ranges* in order, adjacent ranges merged."""
    joined: list[tuple[int, int]] = []
    for first, last in ranges:
        if joined and joined[-1][1] + 1 == first:
            joined[-1] = (joined[-1][0], last)
        else:
            joined.append((first, last))
    return joined


def conclude(known: Mapping[Direction, KnownAnswers], most_entries: int) -> Conclusions:
    """Conclusions from each direction's answers; *most_entries* is the highest entry count of a PDO in the file."""
    both = [*_common(known, most_entries)]
    each = {way: one.answers for way, one in known.items()}
    profile = [*both, *profile_values(known), *gate_for_profile(each.values())]
    family = [*both, *family_values(known), *gate_for_family(each)]
    return Conclusions(tuple(profile), tuple(rules_of_operational(family, each)))


def _common(known: Mapping[Direction, KnownAnswers], most_entries: int) -> Iterator[Learnt]:
    """Values with the same name in profile and family."""
    each = list(known.values())
    yield from _max_entries(each, most_entries)
    yield from _max_entry_bits(each)
    yield from _first(_granularity(answers) for answers in each)
    policies = {way: found for way, answers in known.items() if (found := _rtr_bit(answers)) is not None}
    for way in Direction:
        if policies:
            yield policies.get(way) or Learnt(f"rtr_bit.{way}", "keep", "not tried: no PDO of this direction could be")
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
    """Longest mappable object, if a longer object was refused only for its length.

    An object of this length was mapped in some direction, or refused only for another reason.
    """
    longest = max((fit.bits for known in each for fit in known.fits), default=0)
    refused = [answer for known in each for answer in longer_refused(known) if answer.probe.entry_bits > longest]
    if longest and refused:
        first = min(refused, key=lambda answer: answer.probe.entry_bits)
        lengths = {entry.bits for known in each for entry in known.subject.objects}
        undecided = [bits for bits in lengths if longest < bits < first.probe.entry_bits]
        yield Learnt("max_entry_bits", max(undecided, default=longest), first.text)
    elif longest == 64:
        yield Learnt("max_entry_bits", 64, "no object was refused because of its length")


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
        return None  # the device holds either value of the bit: something else was refused
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

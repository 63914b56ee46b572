"""What a device's answers mean for a simulated family that answers the same. Pure; asks nobody."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from dvtcli.domain.learning.file_limits import taken_beyond
from dvtcli.domain.learning.learnt_value import Learnt
from dvtcli.domain.learning.probe import ProbeAnswer
from dvtcli.domain.learning.probe_table import AGAIN, OTHER_WAY, RESTRICTED, TYPES, KnownAnswers
from dvtcli.domain.learning.summaries import access_answer, has_one_cause, highest_time, longer_refused, types_taken
from dvtcli.domain.mapping import DUMMY_BITS
from dvtcli.domain.pdo import Direction

#: Checks that one probe of the same name is about: that it is accepted says as much as an abort code.
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
#: Checks of which one refusal tells the code, whatever else is accepted.
_FIRST_REFUSED = frozenset(
    {"granularity", "dummy", "rtr-bit", "extended", "inhibit-high", "event-high", "restricted", "no-entry"}
)

#: Checks of which a refusal tells nothing if the length of the entry explains it.
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
    """The abort code of each check that was made, 0 for accepted."""
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

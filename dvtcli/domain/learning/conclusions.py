"""What a device's answers mean: values of a profile, and how a simulated family answers the same. Pure; asks nobody."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby

from dvtcli.domain.learning.probe import Answer
from dvtcli.domain.learning.probe_table import RESTRICTED, TYPES, Known
from dvtcli.domain.mapping import DUMMY_BITS
from dvtcli.domain.pdo import Direction

#: What a value of a profile or of a family may be.
Value = bool | int | str | list["Value"]
#: Checks that one probe of the same name is about: that it is accepted says as much as an abort code.
_PLAIN = frozenset(
    {
        "not-mappable", "missing-object", "missing-sub-index", "entry-zero", "entry-too-long", "entry-too-short",
        "count-beyond", "count-over-zero", "count-over-no-bits", "too-many-bits", "entry-again-counted",
        "entry-while-counted", "type-without-rtr", "empty-enabled", "cob-id-again", "cob-id-while-valid", "count-again",
        "count-while-valid", "entry-again", "entry-while-valid", "type-while-valid", "inhibit-while-valid",
        "event-while-valid", "sync-start-while-valid", "beyond-frame", "dummy-sub-index",
    }
)  # fmt: skip
#: Checks of which one refusal tells the code, whatever else is accepted.
_FIRST_REFUSED = frozenset(
    {"granularity", "dummy", "rtr-bit", "extended", "inhibit-high", "event-high", "restricted", "no-entry"}
)


@dataclass(frozen=True, slots=True)
class Learnt:
    """One value, by its *key* with its tables (`rtr_bit.tpdo`), and the *evidence* for it."""

    key: str
    value: Value
    evidence: str


@dataclass(frozen=True, slots=True)
class Conclusions:
    """What was learnt: *profile* is what the tool must know, *family* how a simulated device answers the same."""

    profile: tuple[Learnt, ...]
    family: tuple[Learnt, ...]


def conclude(known: Mapping[Direction, Known], most_entries: int) -> Conclusions:
    """What the answers of each direction mean; *most_entries* is how many the file gives the PDO that has most."""
    both = [*_common(known, most_entries)]
    profile = [*both, *_profile(known)]
    family = [*both, *_family(known)]
    return Conclusions(tuple(profile), tuple(family))


def _common(known: Mapping[Direction, Known], most_entries: int) -> Iterator[Learnt]:
    """What profile and family call the same."""
    each = list(known.values())
    yield from _max_entries(each, most_entries)
    yield from _first(_max_entry_bits(one) for one in each)
    yield from _first(_granularity(one) for one in each)
    policies = {way: found for way, one in known.items() if (found := _rtr_bit(one)) is not None}
    for way in Direction:
        if policies:
            yield policies.get(way) or Learnt(f"rtr_bit.{way}", "keep", "not asked: no PDO of this direction could be")
    yield from _first(_extended(one) for one in each)
    if Direction.RPDO in known:
        yield from _dummies(known[Direction.RPDO])


def _first(found: Iterable[Learnt | None]) -> Iterator[Learnt]:
    yield from [one for one in found if one is not None][:1]


def _max_entries(each: list[Known], most_entries: int) -> Iterator[Learnt]:
    counted = [one for one in each if one.fits]
    if not counted:
        return
    most = max(counted, key=lambda one: one.max_entries)
    last = most.answers.get(f"entry {most.max_entries}") or next(a for a in most.answers.values() if a.accepted)
    if all(one.max_entries == len(one.subject.entries) for one in counted) and most_entries > most.max_entries:
        evidence = f"{most.subject.pdo.label} took all {most.max_entries} that it has, others have {most_entries}"
        yield Learnt("max_entries", most_entries, evidence)
    else:
        yield Learnt("max_entries", most.max_entries, last.text)


def _max_entry_bits(known: Known) -> Learnt | None:
    longest = max((fit.bits for fit in known.fits), default=0)
    refused = _longer_refused(known)
    if not longest:
        return None
    if refused:
        return Learnt("max_entry_bits", longest, refused[0].text)
    return Learnt("max_entry_bits", 64, "no object was refused for its length") if longest == 64 else None


def _longer_refused(known: Known) -> list[Answer]:
    """The refusals of objects that are longer than any that was taken."""
    longest = max((fit.bits for fit in known.fits), default=64)
    asked = ((fit.bits, known.answers.get(f"map {fit}")) for fit in known.subject.fits)
    return [answer for bits, answer in asked if bits > longest and answer is not None and answer.code]


def _granularity(known: Known) -> Learnt | None:
    for bits in (1, 2, 4):
        if known.accepted(f"entry of {bits} bits"):
            return Learnt("granularity", bits, known.answers[f"entry of {bits} bits"].text)
    if any(fit.bits == 1 for fit in known.fits):
        return Learnt("granularity", 1, "an object of 1 bit was mapped")
    if known.accepted("entry-too-short") and known.refused("entry of 4 bits"):
        return Learnt("granularity", 8, known.answers["entry of 4 bits"].text)
    return None


def _rtr_bit(known: Known) -> Learnt | None:
    clear, as_set = known.answers.get("bit 30 clear"), known.answers.get("bit 30 set")
    if clear is None or as_set is None or clear.code is None or as_set.code is None:
        return None
    key = f"rtr_bit.{known.subject.pdo.direction}"
    if clear.accepted == as_set.accepted:
        return Learnt(key, "keep", f"{clear.text}; {as_set.text}")
    return Learnt(key, "clear", as_set.text) if clear.accepted else Learnt(key, "set", clear.text)


def _extended(known: Known) -> Learnt | None:
    answer = known.answers.get("bit 29")
    return None if answer is None or answer.code is None else Learnt("extended_ids", answer.accepted, answer.text)


def _dummies(known: Known) -> Iterator[Learnt]:
    answers = {index: known.answers.get(f"dummy {index}") for index in DUMMY_BITS}
    if any(answer is None or answer.code is None for answer in answers.values()):
        return
    taken = [index for index, answer in answers.items() if answer is not None and answer.accepted]
    texts = [answer.text for answer in answers.values() if answer is not None]
    yield Learnt("dummies", list(taken), texts[0] if len(taken) in (0, len(texts)) else "; ".join(texts))


def _profile(known: Mapping[Direction, Known]) -> Iterator[Learnt]:
    """What only the tool must know."""
    tpdo, rpdo = known.get(Direction.TPDO), known.get(Direction.RPDO)
    if tpdo is not None:
        ranges = [(first, last) for first, last, code in _types(tpdo) if not code]
        if ranges:
            evidence = "; ".join(
                tpdo.answers[f"type {value}"].text for value in TYPES if f"type {value}" in tpdo.answers
            )
            yield Learnt("transmission_types", [[first, last] for first, last in _joined(ranges)], evidence)
    for way, key, access in ((tpdo, "rw_in_tpdo", "rw"), (tpdo, "rww_in_tpdo", "rww"), (rpdo, "rw_in_rpdo", "rw")):
        answer = None if way is None else way.answers.get(f"access {access}")
        if answer is not None and answer.code is not None:
            yield Learnt(key, "fine" if answer.accepted else "error", answer.text)
    times = [
        (highest, text)
        for one in known.values()
        for name in ("inhibit time", "event timer")
        if (found := _highest(one, name)) is not None
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


def _types(known: Known) -> list[tuple[int, int, int]]:
    """First and last transmission type, and abort code: between two that answer alike all do. Empty if one did not."""
    answers = [(value, known.answers.get(f"type {value}")) for value in TYPES]
    codes = [(value, answer.code) for value, answer in answers if answer is not None and answer.code is not None]
    if len(codes) < len(TYPES):
        return []
    found = []
    for code, group in groupby(codes, key=lambda one: one[1]):
        values = [value for value, _ in group]
        found.append((values[0], values[-1], code or 0))
    return [
        (first, last if n + 1 == len(found) else found[n + 1][0] - 1, code)
        for n, (first, last, code) in enumerate(found)
    ]


def _highest(known: Known, name: str) -> tuple[int, str] | None:
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


def _family(known: Mapping[Direction, Known]) -> Iterator[Learnt]:
    """How a simulated device answers the same."""
    yield from _family_types(known)
    yield from _accesses(known)
    for name, key in (("inhibit time", "max_inhibit_time"), ("event timer", "max_event_timer")):
        found = [highest for one in known.values() if (highest := _highest(one, name)) is not None]
        if found:
            value, text = max(found)
            yield Learnt(key, value, text)
    restricted = [answer for one in known.values() for answer in _restricted(one)]
    if restricted:
        refused = [answer for answer in restricted if answer.code]
        yield Learnt("restricted_ids_refused", bool(refused), (refused or restricted)[0].text)
    if Direction.TPDO in known:
        yield from _tpdo_dummies(known[Direction.TPDO])
    for way in Direction:
        yield from _answers(way, known[way]) if way in known else ()


def _family_types(known: Mapping[Direction, Known]) -> Iterator[Learnt]:
    for way, one in known.items():
        ranges = _types(one)
        if ranges:
            evidence = "; ".join(one.answers[f"type {value}"].text for value in TYPES)
            yield Learnt(f"pdo_types.{way}", [list(each) for each in ranges], evidence)


def _accesses(known: Mapping[Direction, Known]) -> Iterator[Learnt]:
    for way, one in known.items():
        answers = {name.removeprefix("access "): a for name, a in one.answers.items() if name.startswith("access ")}
        if answers and all(answer.code is not None for answer in answers.values()):
            taken = [access for access, answer in answers.items() if answer.accepted]
            evidence = "; ".join(f"{access}: {answer.text}" for access, answer in answers.items())
            yield Learnt(f"{way}_access", list(taken), evidence)


def _restricted(known: Known) -> list[Answer]:
    found = (known.answers.get(f"CAN-ID 0x{can_id:03X}") for can_id in RESTRICTED)
    return [answer for answer in found if answer is not None and answer.code is not None]


def _tpdo_dummies(known: Known) -> Iterator[Learnt]:
    answers = [answer for index in DUMMY_BITS if (answer := known.answers.get(f"dummy {index}")) is not None]
    codes = {answer.code for answer in answers}
    if len(codes) == 1 and (code := codes.pop()) is not None:
        yield Learnt("tpdo_dummies", code, answers[0].text)
    elif 0 in codes:
        yield Learnt("tpdo_dummies", 0, next(answer for answer in answers if answer.accepted).text)


def _answers(way: Direction, known: Known) -> Iterator[Learnt]:
    """The abort code of each check that was made, 0 for accepted."""
    found: dict[str, Answer] = {}
    for answer in known.answers.values():
        check = answer.probe.check
        if answer.code is None or check in found:
            continue
        if check in _PLAIN or (check in _FIRST_REFUSED and answer.code):
            found[check] = answer
    longer = _longer_refused(known)
    if longer:
        found["entry-bits"] = longer[0]
    elif (answer_72 := known.answers.get("entry of 72 bits")) is not None and known.accepted("entry-too-long"):
        found["entry-bits"] = answer_72
    wrong = [a for name, a in known.answers.items() if name.startswith("access ") and a.code]
    if wrong:
        found["wrong-direction"] = wrong[0]
    for check, answer in found.items():
        if answer.code is not None:
            yield Learnt(f"answers.{way}.{check}", answer.code, answer.text)

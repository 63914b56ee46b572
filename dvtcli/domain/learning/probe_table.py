"""The probes: downloads that show a device's limits, and how one answer leads to the next question.

Sources: CiA 301, 7.5.2.35 to 7.5.2.38, and differences between public stacks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from dvtcli.domain.learning.probe import (
    IN_OPERATIONAL,
    IN_PRE_OPERATIONAL,
    Probe,
    ProbeAnswer,
    ProbeCondition,
    ProbedPdo,
    ProbeWrite,
    Stand,
    while_operational,
)
from dvtcli.domain.learning.read_dictionary import limit_probes
from dvtcli.domain.pdo import DUMMY_BITS, MAX_PDO_BITS, PdoMappingEntry
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME, SYNC_START, TRANSMISSION_TYPE

#: An event timer and an inhibit time that no device refuses for its size.
_SHORT = 10


def next_time(answers: Mapping[str, ProbeAnswer], name: str) -> int | None:
    """The time to probe next; None if the highest time is known, or cannot be found."""
    values = {
        int(one.rpartition(" ")[2]): answer
        for one, answer in answers.items()
        if one.startswith(f"{name} ") and one.rpartition(" ")[2].isdecimal()
    }
    if any(answer.code is None for answer in values.values()):
        return None
    kept = [value for value, answer in values.items() if answer.kept]
    if not kept:
        return next((value for value in (0xFFFF, _SHORT) if value not in values), None)
    highest = max(kept)
    above = min((value for value in values if value > highest), default=highest)
    return (highest + above) // 2 if above - highest > 1 else None


#: Probed transmission types: the ends of the standard's ranges, and values between.
TYPES = (0, 1, 2, 120, 239, 240, 241, 246, 251, 252, 253, 254, 255)
ON_REQUEST = (252, 253)
#: Restricted CAN-IDs in CiA 301, one per range (table 40).
RESTRICTED = (0x000, 0x001, 0x101, 0x180, 0x581, 0x601, 0x6E0, 0x701)
_NO_RTR, _EXTENDED, _INVALID = 1 << 30, 1 << 29, 1 << 31
#: Name of the probe with an object that only the other direction maps.
OTHER_WAY = "object of the other direction"
#: Suffix of a probe repeated because of contradictory answers.
AGAIN = ", again"
#: Prefix of probes that map a whole object.
_WHOLE = ("map ", "access ")


@dataclass(frozen=True, slots=True)
class KnownAnswers:
    """Answers so far, by probe name."""

    subject: ProbedPdo
    answers: Mapping[str, ProbeAnswer]

    def accepted(self, name: str) -> bool:
        """Whether the probe *name* or its repetition was accepted."""
        return any(
            probe_name in self.answers and self.answers[probe_name].accepted for probe_name in (name, name + AGAIN)
        )

    def refused(self, name: str) -> bool:
        """Whether the probe *name* was made, and answered with an abort."""
        return name in self.answers and bool(self.answers[name].code)

    @property
    def fits(self) -> tuple[PdoMappingEntry, ...]:
        """Objects that the device mapped in this direction, the shortest first."""
        return tuple(fit for fit in self.subject.fits if self.accepted(fit_name(fit)))

    @property
    def mapped(self) -> dict[PdoMappingEntry, ProbeAnswer]:
        """Every object probed as a whole, with its last answer."""
        found: dict[PdoMappingEntry, ProbeAnswer] = {}
        for name, answer in self.answers.items():
            if name.startswith(_WHOLE) and answer.code is not None:
                found[PdoMappingEntry.from_raw(int.from_bytes(answer.probe.asked.data, "little"))] = answer
        return found

    def refused_for(self, feature: Callable[[PdoMappingEntry], object]) -> list[ProbeAnswer]:
        """Refusals explained by *feature* alone: all other features of the object were accepted together.

        Features are length, access and kind. An object whose *feature* was accepted for another object does not count.
        """
        asked = self.mapped
        taken = [entry for entry, answer in asked.items() if answer.accepted]
        values = {feature(entry) for entry in taken}
        others = [candidate for candidate in (self.length, self.access, self.kind) if candidate != feature]
        return [
            answer
            for entry, answer in asked.items()
            if not answer.accepted
            and feature(entry) not in values
            and any(all(other(entry) == other(taken_entry) for other in others) for taken_entry in taken)
        ]

    def length(self, entry: PdoMappingEntry) -> int:
        """The length of an object in bits."""
        return entry.bits

    def access(self, entry: PdoMappingEntry) -> str:
        """An object's access type in its file, "" if unknown."""
        features = self.subject.features.get(entry)
        return "" if features is None else features.access

    def kind(self, entry: PdoMappingEntry) -> str:
        """An object's kind of number in its file, "" if unknown."""
        features = self.subject.features.get(entry)
        return "" if features is None else features.kind

    @property
    def max_entries(self) -> int:
        """The highest accepted entry, 0 for none."""
        taken = [number for number in range(1, 65) if self.accepted(f"entry {number}")]
        return max(taken, default=int(bool(self.fits)))


def fit_name(fit: PdoMappingEntry) -> str:
    """Name of the probe that maps *fit*."""
    return f"map {fit}"


def next_probes(known: KnownAnswers) -> list[Probe]:
    """The next probes after the answers so far; empty if all were answered."""
    asked = known.answers.keys()
    for stage in _STAGES:
        found = [probe for probe in stage(known) if probe.name not in asked]
        if found:
            return found
    return []


def _entry(known: KnownAnswers, number: int, word: int) -> ProbeWrite:
    return ProbeWrite(known.subject.pdo.mapping_index, number, word.to_bytes(4, "little"))


def _count(known: KnownAnswers, number: int) -> ProbeWrite:
    return ProbeWrite(known.subject.pdo.mapping_index, 0, bytes([number]))


def _cob_id(known: KnownAnswers, word: int) -> ProbeWrite:
    return ProbeWrite(known.subject.pdo.communication_index, 1, word.to_bytes(4, "little"))


def _parameter(known: KnownAnswers, sub_index: int, value: int) -> ProbeWrite:
    size = len(known.subject.parameters[sub_index])
    return ProbeWrite(known.subject.pdo.communication_index, sub_index, value.to_bytes(size, "little"))


def _probe(
    known: KnownAnswers,
    name: str,
    sense: str,
    *writes: ProbeWrite,
    stand: Stand = Stand.EMPTY,
    check: str = "",
    where: ProbeCondition = ProbeCondition.ANYWHERE,
) -> Probe:
    return Probe(pdo=known.subject.pdo, name=name, sense=sense, stand=stand, writes=writes, check=check, where=where)


def _objects(known: KnownAnswers) -> Iterator[Probe]:
    """Probe mappable objects, until one is accepted per length and kind."""
    taken = {(fit.bits, known.kind(fit)) for fit in known.fits}
    for fit in known.subject.fits:
        if fit_name(fit) in known.answers or (fit.bits, known.kind(fit)) not in taken:
            yield _probe(known, fit_name(fit), f"an object of {fit.bits} bits is mapped", _entry(known, 1, fit.raw))
            taken.add((fit.bits, known.kind(fit)))
    asked = {fit.bits for fit in known.subject.fits if fit_name(fit) in known.answers}
    if asked != {fit.bits for fit in known.subject.fits}:
        return  # the accepted lengths decide the further probes
    other_way = known.subject.other_way
    if other_way is not None:
        sense = "an object that only the other direction maps is mapped"
        yield _probe(known, OTHER_WAY, sense, _entry(known, 1, other_way.raw), check="wrong-direction")
    for access, entries in known.subject.by_access.items():
        yield _probe(
            known, f"access {access}", f"a mappable object that is {access} is mapped",
            _entry(known, 1, _like_one_that_is_taken(known, entries).raw), check="wrong-direction",
        )  # fmt: skip


def _like_one_that_is_taken(known: KnownAnswers, entries: Sequence[PdoMappingEntry]) -> PdoMappingEntry:
    """An entry whose length and kind the device maps, for a single cause of refusal; else the first."""
    alike = {(fit.bits, known.kind(fit)) for fit in known.fits}
    lengths = {fit.bits for fit in known.fits}
    best = [entry for entry in entries if (entry.bits, known.kind(entry)) in alike]
    return (best or [entry for entry in entries if entry.bits in lengths] or list(entries))[0]


def _contradictions(known: KnownAnswers) -> Iterator[Probe]:
    """Repeat probes of refused objects whose length, access and kind were each accepted elsewhere."""
    asked = known.mapped
    taken = [entry for entry, answer in asked.items() if answer.accepted]
    features = (known.length, known.access, known.kind)
    for entry, answer in asked.items():
        unexplained = all(any(feature(entry) == feature(taken_entry) for taken_entry in taken) for feature in features)
        if unexplained and known.access(entry) and not answer.accepted and not answer.probe.name.endswith(AGAIN):
            yield replace(answer.probe, name=answer.probe.name + AGAIN)


def _entries(known: KnownAnswers) -> Iterator[Probe]:
    """Probe the legal contents of an entry, one property at a time."""
    if not known.fits:
        return
    fit, subject = known.fits[0], known.subject

    def entry(check: str, sense: str, word: int, name: str = "") -> Probe:
        return _probe(known, name or check, sense, _entry(known, 1, word), check=check)

    if subject.unmappable:
        word = _like_one_that_is_taken(known, subject.unmappable).raw
        yield entry("not-mappable", "an object that is not mappable is mapped", word)
    yield entry("missing-object", "a missing object is mapped", subject.absent << 16 | fit.bits)
    yield entry("missing-sub-index", "a missing sub-index is mapped", fit.index << 16 | 0xEE << 8 | fit.bits)
    yield entry("entry-zero", "an entry of 0 is accepted", 0)
    yield entry("no-bits", "an entry of 0 bits is accepted", fit.raw & ~0xFF, "entry of 0 bits")
    half = next((shorter for shorter in known.fits if 2 * shorter.bits in {other.bits for other in known.fits}), fit)
    yield entry("entry-too-long", "an entry may be longer than its object", (half.raw & ~0xFF) | 2 * half.bits)
    yield entry("entry-bits", "an entry may be longer than 64 bits", (fit.raw & ~0xFF) | 72, "entry of 72 bits")
    longest = max(known.fits, key=lambda mapped: mapped.bits)
    if longest.bits > 8:
        yield entry(
            "entry-too-short", "an entry may be shorter than its object", (longest.raw & ~0xFF) | (longest.bits - 8)
        )
    for bits in (1, 2, 4):
        if longest.bits > bits:
            word = (longest.raw & ~0xFF) | bits
            yield entry("granularity", f"an entry of {bits} bits is accepted", word, f"entry of {bits} bits")
    for index, bits in DUMMY_BITS.items():
        word = index << 16 | bits
        yield entry("dummy", f"the dummy 0x{index:04X} is mapped", word, f"dummy {index}")
        if known.accepted(f"dummy {index}"):
            yield entry("dummy-sub-index", "sub-index 01 of a dummy is mapped", word | 1 << 8)


def _how_many(known: KnownAnswers) -> Iterator[Probe]:
    """Probe the number of entries: the last readable entry, and if refused all earlier entries."""
    if not known.fits:
        return
    word, last = known.fits[0].raw, len(known.subject.entries)

    def number(which: int) -> Probe:
        return _probe(
            known, f"entry {which}", f"there is an entry {which}", _entry(known, which, word),
            check="no-entry" if which > 1 else "",
        )  # fmt: skip

    if last > 1:
        yield number(last)
    if last > 1 and known.refused(f"entry {last}"):
        yield from map(number, range(2, last))
    if last < 64 and not known.subject.more:
        yield _probe(
            known, f"entry {last + 1}", "an entry after the last is accepted", _entry(known, last + 1, word)
        )  # fmt: skip


def _counts(known: KnownAnswers) -> Iterator[Probe]:
    """Probe the entries that a count may cover."""
    if not known.fits:
        return
    fit, most = known.fits[0], known.max_entries

    def filled(number: int, entry: PdoMappingEntry) -> list[ProbeWrite]:
        return [_entry(known, position, entry.raw) for position in range(1, number + 1)]

    if most < 64 and not known.subject.more:
        yield _probe(
            known, "count-beyond", "a count above the number of entries is accepted",
            *filled(most, fit), _count(known, most + 1), check="count-beyond",
        )  # fmt: skip
    if known.accepted("entry-zero"):
        yield _probe(
            known, "count-over-zero", "a count may cover an entry of 0",
            _entry(known, 1, 0), _count(known, 1), check="count-over-zero",
        )  # fmt: skip
    if known.accepted("entry of 0 bits"):
        yield _probe(
            known, "count-over-no-bits", "a count may cover an entry of 0 bits",
            _entry(known, 1, fit.raw & ~0xFF), _count(known, 1), check="count-over-no-bits",
        )  # fmt: skip
    for mapped in known.fits:
        full = MAX_PDO_BITS // mapped.bits
        if full <= most:
            yield _probe(
                known, "64 bits", "a mapping may have 64 bits", *filled(full, mapped), _count(known, full)
            )  # fmt: skip
            break
    for mapped in known.fits:
        over = MAX_PDO_BITS // mapped.bits + 1
        if over <= most:
            yield _probe(
                known, "too-many-bits", "a mapping may have more than 64 bits",
                *filled(over, mapped), _count(known, over), check="too-many-bits",
            )  # fmt: skip
            break


def _while_counted(known: KnownAnswers) -> Iterator[Probe]:
    """Probe writes to a mapping while its count is not 0."""
    if not known.fits:
        return
    fit = known.fits[0]
    yield _probe(
        known, "entry-again-counted", "the same entry is accepted while the count is 1",
        _entry(known, 1, fit.raw), stand=Stand.FILLED, check="entry-again-counted",
    )  # fmt: skip
    other = _other(known)
    if other is not None:
        yield _probe(
            known, "entry-while-counted", "another entry is accepted while the count is 1",
            _entry(known, 1, other), stand=Stand.FILLED, check="entry-while-counted",
        )  # fmt: skip


def _other(known: KnownAnswers) -> int | None:
    """An accepted entry other than the filled PDO's entry."""
    words = [fit.raw for fit in known.fits[1:]]
    words += [index << 16 | bits for index, bits in DUMMY_BITS.items() if known.accepted(f"dummy {index}")]
    return words[0] if words else None


def _cob_ids(known: KnownAnswers) -> Iterator[Probe]:
    """Probe COB-IDs while the PDO is disabled: bits 30 and 29, another CAN-ID."""
    off = known.subject.off.raw
    for name, sense, word, check in (
        ("bit 30 clear", "bit 30 (no RTR) may be clear", off & ~_NO_RTR, "rtr-bit"),
        ("bit 30 set", "bit 30 (no RTR) may be set", off | _NO_RTR, "rtr-bit"),
    ):
        yield _probe(known, name, sense, _cob_id(known, word), check=check)
    bits = off & _NO_RTR
    if not (off & _EXTENDED):
        word = _INVALID | bits | _EXTENDED | 0x18000
        yield _probe(known, "bit 29", "a CAN-ID may have 29 bits", _cob_id(known, word), check="extended")


def _rtr_allowed(known: KnownAnswers) -> list[ProbeWrite]:
    """A write that allows remote requests for the PDO, if the device supports them and forbids them now."""
    off = known.subject.off
    if off.rtr_allowed or not known.accepted("bit 30 clear"):
        return []
    return [_cob_id(known, off.raw & ~_NO_RTR)]


def _parameters(known: KnownAnswers) -> Iterator[Probe]:
    """Probe communication parameters while the PDO is disabled."""
    parameters = known.subject.parameters
    if TRANSMISSION_TYPE in parameters:
        for value in TYPES:
            before = _rtr_allowed(known) if value in ON_REQUEST else []
            write = _parameter(known, TRANSMISSION_TYPE, value)
            yield _probe(known, f"type {value}", f"transmission type {value} is accepted", *before, write, check="type")
        if known.accepted("bit 30 set") and known.accepted("type 252"):
            forbidden = _cob_id(known, known.subject.off.raw | _NO_RTR)
            write = _parameter(known, TRANSMISSION_TYPE, 252)
            yield _probe(
                known, "type-without-rtr", "type 252 is accepted while bit 30 is set", forbidden, write,
                check="type-without-rtr",
            )  # fmt: skip
    for sub_index, name, check in (
        (INHIBIT_TIME, "inhibit time", "inhibit-high"),
        (EVENT_TIMER, "event timer", "event-high"),
    ):
        if sub_index in parameters:
            yield from _highest(known, sub_index, name, check)
    if SYNC_START in parameters:
        write = _parameter(known, SYNC_START, 1)
        yield _probe(known, "SYNC start value 1", "a SYNC start value is accepted", write)


def _highest(known: KnownAnswers, sub_index: int, name: str, check: str) -> Iterator[Probe]:
    """Search for the highest accepted time."""
    value = next_time(known.answers, name)
    if value is not None:
        write = _parameter(known, sub_index, value)
        yield _probe(known, f"{name} {value}", f"{name} {value} is accepted", write, check=check)


def _while_on(known: KnownAnswers) -> Iterator[Probe]:
    """Probe writes while the PDO is enabled, and whether an empty PDO may be enabled."""
    if not known.subject.spare or not known.fits:
        return
    first, second = known.subject.spare
    fit, bits = known.fits[0], known.subject.off.raw & (_NO_RTR | _EXTENDED)

    def on(check: str, sense: str, write: ProbeWrite, stand: Stand = Stand.ON) -> Probe:
        return _probe(known, check, sense, write, stand=stand, check=check, where=ProbeCondition.QUIET)

    yield on("empty-enabled", "a PDO without a mapping may be enabled", _cob_id(known, bits | first), Stand.EMPTY)
    yield on("enable", "a PDO can be enabled", _cob_id(known, bits | first), Stand.FILLED)
    if not known.accepted("enable"):
        return
    yield on("cob-id-again", "the same COB-ID is accepted while enabled", _cob_id(known, bits | first))
    yield on("cob-id-while-valid", "another CAN-ID is accepted while enabled", _cob_id(known, bits | second))
    yield on("count-again", "the same count is accepted while enabled", _count(known, 1))
    yield on("count-while-valid", "count 0 is accepted while enabled", _count(known, 0))
    yield on("entry-again", "the same entry is accepted while enabled", _entry(known, 1, fit.raw))
    other = _other(known)
    if other is not None:
        yield on("entry-while-valid", "another entry is accepted while enabled", _entry(known, 1, other))
    for sub_index, check, sense in (
        (TRANSMISSION_TYPE, "type-while-valid", "a transmission type is accepted while enabled"),
        (INHIBIT_TIME, "inhibit-while-valid", "an inhibit time is accepted while enabled"),
        (EVENT_TIMER, "event-while-valid", "an event timer is accepted while enabled"),
        (SYNC_START, "sync-start-while-valid", "a SYNC start value is accepted while enabled"),
    ):
        value = _another_value(known, sub_index)
        if value is not None:
            yield on(check, sense, _parameter(known, sub_index, value))


def _another_value(known: KnownAnswers, sub_index: int) -> int | None:
    """A value accepted while the PDO was disabled, other than its present value."""
    if sub_index not in known.subject.parameters:
        return None
    held = int.from_bytes(known.subject.parameters[sub_index], "little")
    names = {TRANSMISSION_TYPE: "type", INHIBIT_TIME: "inhibit time", EVENT_TIMER: "event timer"}
    name = names.get(sub_index, "SYNC start value")
    asked = (one.rpartition(" ") for one, answer in known.answers.items() if answer.kept)
    values = sorted(int(value) for what, _, value in asked if what == name and value.isdecimal())
    return next((value for value in values if value not in (held, *ON_REQUEST)), None)


def _isolated(known: KnownAnswers) -> Iterator[Probe]:
    """Probe restricted CAN-IDs: no other node may be on the bus."""
    if not known.accepted("enable"):
        return
    bits = known.subject.off.raw & _NO_RTR
    for can_id in RESTRICTED:
        yield _probe(
            known, f"CAN-ID 0x{can_id:03X}", f"a PDO may be enabled on CAN-ID 0x{can_id:03X}",
            _cob_id(known, bits | can_id), stand=Stand.FILLED, check="restricted", where=ProbeCondition.ISOLATED,
        )  # fmt: skip
    yield _probe(
        known, "CAN-ID 0x800", "a CAN-ID above 0x7FF is accepted without bit 29",
        _cob_id(known, bits | 0x800), stand=Stand.FILLED, check="beyond-frame", where=ProbeCondition.ISOLATED,
    )  # fmt: skip


def _again(known: KnownAnswers) -> Iterator[Probe]:
    """Repeat probes refused in OPERATIONAL in PRE-OPERATIONAL: only both answers show the role of the state."""
    for probe in while_operational(known.subject):
        if known.refused(probe.name):
            name = probe.name.replace(IN_OPERATIONAL, IN_PRE_OPERATIONAL)
            yield replace(probe, name=name, stand=Stand.EMPTY, where=ProbeCondition.ANYWHERE)


_STAGES: tuple[Callable[[KnownAnswers], Iterator[Probe]], ...] = (
    _objects,
    _contradictions,
    _entries,
    _how_many,
    _counts,
    _while_counted,
    _cob_ids,
    _parameters,
    lambda known: limit_probes(known.subject),
    _while_on,
    _isolated,
    _again,
)

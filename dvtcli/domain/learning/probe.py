"""A probe: SDO downloads to one disabled PDO, and the device's answer."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from dvtcli.domain.abort import Abort, abort_text
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Direction, Pdo, PdoConfig, PdoMappingEntry, is_mapping_index
from dvtcli.domain.plan import TRANSMISSION_TYPE

#: `ProbeAnswer.code` of an accepted value.
ACCEPTED = 0


class Stand(StrEnum):
    """How the PDO stands before a probe."""

    FOUND = "as it was found, off"
    #: every PDO rolled back
    BACK = "as it was found"
    EMPTY = "off, count 0"
    FILLED = "off, one entry"
    ON = "enabled, one entry, on an unused CAN-ID"


class ProbeCondition(StrEnum):
    """Precondition of a probe."""

    ANYWHERE = "anywhere"
    #: an enabled PDO: needs PRE-OPERATIONAL, and a CAN-ID that is neither configured nor received
    QUIET = "PRE-OPERATIONAL and a quiet CAN-ID"
    #: a CAN-ID with a meaning for other nodes
    ISOLATED = "a bus without other nodes"
    #: the node as it was found, in OPERATIONAL
    OPERATIONAL = "a bus without other nodes, and a node that was OPERATIONAL before"
    #: a write to the device's memory
    STORE = "leave to store"


@dataclass(frozen=True, slots=True)
class ProbeWrite:
    """An SDO download."""

    index: int
    sub_index: int
    data: bytes

    @property
    def place(self) -> tuple[int, int]:
        """Index and sub-index."""
        return self.index, self.sub_index

    @property
    def label(self) -> str:
        """Index and sub-index as `1A03:01`."""
        return f"{self.index:04X}:{self.sub_index:02X}"

    def __str__(self) -> str:
        value = f"0x{int.from_bytes(self.data, 'little'):0{2 * len(self.data)}X}"
        return f"0x{self.label} <- {value}"


@dataclass(frozen=True, slots=True)
class Probe:
    """A probe of *pdo*, None for the device: the last of *writes*, after the others were accepted, from *stand*.

    *name* is unique in a run, *sense* describes the question for people. *check* is the simulated device's
    check for the same write, "" for none.
    """

    pdo: Pdo | None
    name: str
    sense: str
    stand: Stand
    writes: tuple[ProbeWrite, ...]
    check: str = ""
    where: ProbeCondition = ProbeCondition.ANYWHERE

    @property
    def label(self) -> str:
        """The probed PDO, else the object."""
        return self.pdo.label if self.pdo is not None else self.asked.label

    @property
    def asked(self) -> ProbeWrite:
        """The download that the device's answer refers to."""
        return self.writes[-1]

    @property
    def entry_bits(self) -> int:
        """Mapped bits of the probed mapping entry."""
        return int.from_bytes(self.asked.data, "little") & 0xFF


@dataclass(frozen=True, slots=True)
class ProbeAnswer:
    """The device's answer to *probe*: an abort code, 0 for accepted, None for no answer (reason: *why*).

    *held* is the object's value afterwards, None if unreadable.
    """

    probe: Probe
    code: int | None
    held: bytes | None = None
    why: str = ""

    @property
    def accepted(self) -> bool:
        """Whether the device took the value."""
        return self.code == ACCEPTED

    @property
    def kept(self) -> bool:
        """Whether the device accepted and kept the value."""
        return self.accepted and self.held == self.probe.asked.data

    @property
    def text(self) -> str:
        """The evidence, for a person: `0x1A03:01 <- 0x60410004 answered 0x06040041 (…)`."""
        asked = self.probe.asked
        if self.code is None:
            return f"{asked} was not asked: {self.why}"
        if self.code:
            return f"{asked} answered 0x{self.code:08X} ({abort_text(self.code)}), {self.probe.stand}"
        held = "" if self.held in (None, asked.data) else f", and reads 0x{_number(self.held):X}"
        return f"{asked} accepted{held}, {self.probe.stand}"


def _number(data: bytes | None) -> int:
    return int.from_bytes(data or b"", "little")


@dataclass(frozen=True, slots=True)
class Features:
    """Reasons besides length to refuse mapping: *access* and *kind* of number."""

    access: str
    kind: str


@dataclass(frozen=True, slots=True)
class ProbedPdo:
    """The probed PDO with its present and probing values.

    *parameters* are the bytes of each readable sub-index of the communication parameter, *entries* the raw words of
    readable sub-indices 1… of the mapping. *spare* are two unused CAN-IDs, none if the PDO must not be enabled. *fits*
    are mappable objects in this direction according to the file, *by_access* the same by access type, one per length,
    *unmappable* other objects; *features* are access and kind of each object. *absent* is a missing index. *more*:
    further entries exist and must not be written, since they refuse their old value. *other_way* is an object that only
    PDOs of the other direction map, if no file gives access types. *limits* are the lowest and the highest value of
    parameters and entries in the file, by index and sub-index.
    """

    pdo: Pdo
    held: PdoConfig
    parameters: Mapping[int, bytes]
    entries: tuple[int, ...]
    fits: tuple[PdoMappingEntry, ...]
    by_access: Mapping[str, tuple[PdoMappingEntry, ...]] = field(default_factory=dict)
    unmappable: tuple[PdoMappingEntry, ...] = ()
    features: Mapping[PdoMappingEntry, Features] = field(default_factory=dict)
    absent: int = 0x5FFE
    spare: tuple[int, ...] = ()
    more: bool = False
    other_way: PdoMappingEntry | None = None
    limits: Mapping[tuple[int, int], tuple[int, int]] = field(default_factory=dict)

    @property
    def off(self) -> CobId:
        """The COB-ID with bit 31 set: its value during probes."""
        return self.held.communication.cob_id.disabled()

    @property
    def objects(self) -> list[PdoMappingEntry]:
        """Mappable objects according to the file, of each length and access."""
        return [*self.fits, *(entry for entries in self.by_access.values() for entry in entries)]


#: Value in a profile or a family.
Value = bool | int | str | list["Value"]


@dataclass(frozen=True, slots=True)
class Learnt:
    """A learnt value with its *key* and tables (`rtr_bit.tpdo`), and the *evidence*."""

    key: str
    value: Value
    evidence: str


@dataclass(frozen=True, slots=True)
class Conclusions:
    """All learnt values: *profile* for the tool, *family* for a simulated device that answers the same."""

    profile: tuple[Learnt, ...]
    family: tuple[Learnt, ...]


#: Suffixes of probe names, by state.
IN_OPERATIONAL, IN_PRE_OPERATIONAL = " in OPERATIONAL", " in PRE-OPERATIONAL"
#: Violations that a device may check in OPERATIONAL only, in words; and a simulated device's check.
_RULES = {"missing-object": "an entry of a missing object", "type 241": "transmission type 241"}
_CHECKS = {"missing-object": "missing-object", "type 241": "type"}
_TAKEN = f" is taken{IN_OPERATIONAL}"
_RESERVED_TYPE = 241
_WHY_NOT = "only on a silent bus with the node OPERATIONAL"
#: Keys of a family about checks: meaningless for a device without checks.
_UNCHECKED = (
    "answers.", "pdo_types.", "rtr_bit.", "tpdo_access", "rpdo_access", "tpdo_dummies", "dummies", "granularity",
    "extended_ids", "max_entry_bits", "restricted_ids_refused",
)  # fmt: skip
#: First and last index of the communication and the mapping parameters of each direction.
_AREAS = {
    Direction.TPDO: ((0x1800, 0x19FF), (0x1A00, 0x1BFF)),
    Direction.RPDO: ((0x1400, 0x15FF), (0x1600, 0x17FF)),
}


def while_operational(subject: ProbedPdo) -> list[Probe]:
    """Probes of a node found OPERATIONAL, before any state change; none if the PDO is enabled.

    An object is first probed with its current value: if refused, another value could not be rolled back.
    """
    return [] if subject.held.enabled else _questions(subject)


def _questions(subject: ProbedPdo) -> list[Probe]:
    pdo = subject.pdo
    count = ProbeWrite(pdo.mapping_index, 0, b"\0")
    asked = {
        "COB-ID": (ProbeWrite(pdo.communication_index, 1, subject.off.raw.to_bytes(4, "little")),),
        "type": tuple(
            ProbeWrite(pdo.communication_index, sub, data)
            for sub, data in subject.parameters.items()
            if sub == TRANSMISSION_TYPE
        ),
        "count": (count,),
        "entry": tuple(ProbeWrite(pdo.mapping_index, 1, word.to_bytes(4, "little")) for word in subject.entries[:1]),
    }
    asked["entry"] = (count, *asked["entry"]) if asked["entry"] else ()
    asked |= _against_rules(subject, count)
    return [
        Probe(
            pdo, f"{name}{IN_OPERATIONAL}", f"{_RULES.get(name) or f'the {name} of a PDO that is off'}{_TAKEN}",
            Stand.FOUND, writes, where=ProbeCondition.OPERATIONAL,
        )
        for name, writes in asked.items()
        if writes
    ]  # fmt: skip


def _against_rules(subject: ProbedPdo, count: ProbeWrite) -> dict[str, tuple[ProbeWrite, ...]]:
    """Writes that the standard forbids in every state: a device may check them in OPERATIONAL only."""
    index, sizes = subject.pdo.communication_index, subject.parameters
    missing = ProbeWrite(subject.pdo.mapping_index, 1, (subject.absent << 16 | 16).to_bytes(4, "little"))
    reserved = ProbeWrite(index, TRANSMISSION_TYPE, bytes([_RESERVED_TYPE]))
    return {"missing-object": (count, missing), "type 241": (reserved,) if TRANSMISSION_TYPE in sizes else ()}


def not_while_operational(subject: ProbedPdo, *, would_be: bool) -> dict[str, ProbeAnswer]:
    """Skipped probes with the reason; *would_be*: a disabled PDO would be probed in OPERATIONAL."""
    pdo = subject.pdo
    why = _WHY_NOT
    if subject.held.enabled:
        why += ", of a PDO that is off"
    if would_be:
        why = f"{pdo.label} is enabled: only a PDO that is off is asked in OPERATIONAL (switch it off first)"
    return {probe.name: ProbeAnswer(probe, None, why=why) for probe in _questions(subject)}


def _is_rule(name: str) -> bool:
    return name.removesuffix(IN_OPERATIONAL) in _RULES


def _pairs(
    answers: Mapping[str, ProbeAnswer], *, rules: bool = False
) -> Iterator[tuple[ProbeAnswer, ProbeAnswer | None]]:
    """Answers in OPERATIONAL, with the PRE-OPERATIONAL answer if probed; only probes of *rules*, or all others."""
    for name, answer in answers.items():
        if name.endswith(IN_OPERATIONAL) and answer.code is not None and _is_rule(name) is rules:
            yield answer, answers.get(name.removesuffix(IN_OPERATIONAL) + IN_PRE_OPERATIONAL)


def _for_the_state(answers: Mapping[str, ProbeAnswer]) -> list[ProbeAnswer]:
    """Refusals in OPERATIONAL of writes accepted in PRE-OPERATIONAL."""
    return [first for first, then in _pairs(answers) if first.code and then is not None and then.accepted]


def gate_for_profile(answers: Iterable[Mapping[str, ProbeAnswer]]) -> Iterator[Learnt]:
    """Whether PDO parameters need PRE-OPERATIONAL; nothing if not probed, or if refused for another reason."""
    each = list(answers)
    refused = [answer for answered in each for answer in _for_the_state(answered)]
    asked = [answer for answered in each for answer, _ in _pairs(answered)]
    if refused:
        yield Learnt("pre_operational_gate", "required", "; ".join(answer.text for answer in refused))
    elif asked and all(answer.accepted for answer in asked):
        yield Learnt("pre_operational_gate", "no", "; ".join(answer.text for answer in asked))


def gate_for_family(answers: Mapping[Direction, Mapping[str, ProbeAnswer]]) -> Iterator[Learnt]:
    """Parameters that a simulated device refuses outside PRE-OPERATIONAL, and the abort code."""
    ranges, refused, asked = [], list[ProbeAnswer](), list[ProbeAnswer]()
    for way, own in answers.items():
        asked += [answer for answer, _ in _pairs(own)]
        for mapping, area in enumerate(_AREAS[way]):
            found = [
                answer for answer in _for_the_state(own) if is_mapping_index(answer.probe.asked.index) == bool(mapping)
            ]
            ranges += [list(area)] if found else []
            refused += found
    if not asked:
        return
    evidence = "; ".join(answer.text for answer in refused or asked)
    yield Learnt("pre_operational_writes", [[first, last] for first, last in ranges], evidence)
    if refused and refused[0].code != Abort.GENERAL:
        yield Learnt("wrong_state", refused[0].code or 0, refused[0].text)


def rules_of_operational(family: list[Learnt], answers: Mapping[Direction, Mapping[str, ProbeAnswer]]) -> list[Learnt]:
    """*family*, reduced if the device checks its rules in OPERATIONAL only.

    Accepted writes in PRE-OPERATIONAL then prove nothing, except for limits and for refusals there.
    """
    pairs = {way: list(_pairs(own, rules=True)) for way, own in answers.items()}
    refused = {
        way: [first for first, then in own if first.code and then and then.accepted] for way, own in pairs.items()
    }
    every = [first for own in refused.values() for first in own]
    gated = any(_for_the_state(own) for own in answers.values())
    if not every or gated or len(every) < sum(map(len, pairs.values())):
        return family
    kept = [learnt for learnt in family if not learnt.key.startswith(_UNCHECKED) or _says_more(learnt)]
    kept.append(Learnt("pdo_rules_always", False, "; ".join(f"{answer.text}, in OPERATIONAL only" for answer in every)))
    for way, own in refused.items():
        for answer in own:
            check = _CHECKS[answer.probe.name.removesuffix(IN_OPERATIONAL)]
            kept.append(Learnt(f"answers.{way}.{check}", answer.code or 0, f"{answer.text}, in OPERATIONAL"))
    return kept


def _says_more(one: Learnt) -> bool:
    return one.key.startswith("answers.") and (one.key.endswith("-limit") or bool(one.value))


def merged(one: Learnt, like: Iterable[tuple[int, int]]) -> Learnt:
    """The ranges of *one*, and the ranges *like* outside the PDO parameters."""
    first_pdo, last_pdo = 0x1400, 0x1BFF
    own = one.value if isinstance(one.value, list) else []
    kept: list[Value] = []
    for first, last in like:
        if first < first_pdo:
            kept.append([first, min(last, first_pdo - 1)])
        if last > last_pdo:
            kept.append([max(first, last_pdo + 1), last])
    return Learnt(one.key, [*own, *kept], one.evidence)

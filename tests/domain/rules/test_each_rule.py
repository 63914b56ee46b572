"""Every rule finds what it is for, and the abort code it names is the one the device gives."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest

from dvtcli.device.read_pdos import present_pdos, read_pdo
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry
from dvtcli.domain.plan import plan_pdo
from dvtcli.domain.profile import Severity
from dvtcli.domain.rules import Finding, Proposal, check_pdo
from dvtcli.errors import SdoAborted
from tests.laws.bench import NODE, DirectSdo, booted, dictionary, profile

ERROR, WARNING, NOTE = Severity.ERROR, Severity.WARNING, Severity.NOTE


def entry(text: str) -> PdoMappingEntry:
    """`6041:00/16` as an entry."""
    place, _, bits = text.partition("/")
    index, _, sub_index = place.partition(":")
    return PdoMappingEntry(int(index, 16), int(sub_index or "0", 16), int(bits))


@dataclass(frozen=True)
class Case:
    """A change of *pdo* on *family*: what *rule* says at *place*, and what the device answers (None: it accepts)."""

    family: str
    pdo: str
    rule: str
    place: str
    abort: int | None = None
    severity: Severity = ERROR
    mapping: tuple[str, ...] | None = None
    parameters: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.family} {self.pdo} {self.rule} {self.place} {self.mapping or self.parameters}"


def m(
    family: str, pdo: str, rule: str, place: str, abort: int | None, *mapping: str, severity: Severity = ERROR
) -> Case:
    return Case(family, pdo, rule, place, abort, severity, mapping)


def p(
    family: str, pdo: str, rule: str, place: str, abort: int | None, severity: Severity = ERROR, **values: Any
) -> Case:
    return Case(family, pdo, rule, place, abort, severity, None, values)


def c(raw: int) -> CobId:
    return CobId.from_raw(raw)


CASES = [
    m("generic", "tpdo1", "object-exists", "0x1A00:02", 0x06020000, "6041:00/16", "5FFF:00/16"),
    m("generic", "tpdo1", "object-exists", "0x1A00:01", 0x06090011, "6401:77/16"),
    m("generic", "tpdo1", "mappable", "0x1A00:01", 0x06040041, "1018:01/32"),
    m("safety", "tpdo1", "safety-object", "0x1A00:01", 0x06040041, "1301:05/32"),
    m("generic", "rpdo1", "direction", "0x1600:01", 0x06040041, "6041:00/16"),
    m("generic", "tpdo1", "read-write-object", "0x1A00:01", 0x06040041, "6040:00/16"),
    m("gen4", "tpdo1", "read-write-object", "0x1A00:01", None, "6040:00/16", severity=WARNING),
    m("gen4", "tpdo1", "advised-against", "0x1A00:01", None, "2220:00/16", severity=WARNING),
    m("generic", "tpdo1", "entry-length", "0x1A00:01", 0x06040041, "6041:00/32"),
    m("generic", "tpdo1", "entry-length", "0x1A00:01", None, "6041:00/8"),
    m("generic", "tpdo1", "entry-length", "0x1A00:01", 0x06090030, "6041:00/0"),
    m("tmcm", "tpdo1", "granularity", "0x1A00:01", 0x06040041, "6041:00/12"),
    m("generic", "tpdo1", "pdo-length", "0x1A00:00", 0x06040042, "606C:00/32", "606C:00/32", "6041:00/16"),
    m("tmcm", "tpdo1", "entry-count", "0x1A00:04", 0x06090011, *["6061:00/8"] * 5),
    m("generic", "tpdo1", "dummy-direction", "0x1A00:01", 0x06040041, "0005:00/8"),
    m("tmcm", "rpdo1", "dummy-supported", "0x1600:01", 0x06040041, "0005:00/8"),
    m("gen4", "rpdo1", "dummy-supported", "0x1600:01", 0x06040041, "0003:00/16"),
    m("gen4", "rpdo1", "dummy-length", "0x1600:01", 0x06040041, "0006:00/32"),
    m("gen4", "rpdo1", "object-exists", "0x1600:01", 0x06090011, "0006:01/16"),
    m("generic", "rpdo1", "double-target", "0x1600:02", None, "6040:00/16", "6040:00/16"),
    m("generic", "tpdo1", "mapped-twice", "0x1A00:02", None, "6041:00/16", "6041:00/16", severity=WARNING),
    m("generic", "tpdo1", "empty-mapping", "0x1800:01", 0x06090030),
    p("generic", "tpdo1", "transmission-type", "0x1800:02", 0x06090030, transmission_type=245),
    p("generic", "rpdo1", "transmission-type", "0x1400:02", 0x06090030, transmission_type=252),
    p("tmcm", "tpdo1", "transmission-type", "0x1800:02", 0x06090030, transmission_type=0),
    p("gen4", "tpdo1", "transmission-type", "0x1800:02", None, WARNING, transmission_type=0),
    p("generic", "tpdo1", "transmission-type", "0x1800:02", 0x06090030, transmission_type=253),
    p("gen4", "tpdo1", "parameter-range", "0x1800:03", 0x06090031, inhibit_time=0x8000),
    p("gen4", "tpdo1", "parameter-range", "0x1800:05", 0x06090031, event_timer=0x8000),
    p("gen4", "tpdo1", "parameter-exists", "0x1800:06", 0x06090011, sync_start_value=1),
    p("tmcm", "tpdo1", "event-timer", "0x1800:05", None, WARNING, event_timer=10, transmission_type=1),
    p("generic", "tpdo1", "event-timer", "0x1800:05", None, NOTE, event_timer=10, transmission_type=1),
    p("generic", "tpdo1", "can-id-restricted", "0x1800:01", 0x06090030, cob_id=c(0x4000_0601)),
    p("generic", "tpdo1", "can-id-restricted", "0x1800:01", 0x06090030, cob_id=c(0x4000_0000)),
    p("generic", "tpdo1", "can-id-restricted", "0x1800:01", 0x06090030, cob_id=c(0x4000_0701)),
    p("generic", "tpdo1", "can-id-length", "0x1800:01", 0x06090030, cob_id=c(0x4000_0801)),
    p("generic", "tpdo1", "can-id-in-use", "0x1800:01", None, cob_id=c(0x4000_0080)),
    p("generic", "tpdo1", "can-id-in-use", "0x1800:01", None, cob_id=c(0x4000_0081)),
    p("generic", "tpdo1", "can-id-in-use", "0x1800:01", None, WARNING, cob_id=c(0x4000_0082)),
    p("generic", "tpdo1", "can-id-in-use", "0x1800:01", None, WARNING, cob_id=c(0x4000_0100)),
    p("generic", "tpdo1", "can-id-clash", "0x1800:01", None, cob_id=c(0x4000_0281)),
    p("generic", "tpdo1", "can-id-default", "0x1800:01", None, NOTE, cob_id=c(0x4000_0301 + 0x100)),
    p("gen4", "tpdo1", "extended-id", "0x1800:01", 0x06090030, cob_id=c(0x2000_1234)),
    p("gen4", "tpdo1", "rtr-bit", "0x1800:01", 0x06090030, cob_id=c(0x4000_0181)),
    p("tmcm", "tpdo1", "rtr-bit", "0x1800:01", 0x06090030, cob_id=c(0x0000_0181)),
    p("roboteq", "tpdo1", "rtr-bit", "0x1800:01", 0x06090030, cob_id=c(0x0000_0181)),
]


def proposed(case: Case, sdo: DirectSdo) -> Proposal:
    described, pdo = dictionary(case.family), Pdo.parse(case.pdo)
    held = {one: read_pdo(sdo, one) for one in present_pdos(sdo, described)}
    now = held.pop(pdo)
    want = now.with_parameters(**case.parameters)
    if case.mapping is not None:
        want = PdoConfig(want.communication, tuple(entry(text) for text in case.mapping))
    return Proposal(NODE, pdo, now, want, held, profile(case.family), described)


def found(case: Case, proposal: Proposal) -> list[Finding]:
    wanted = (case.rule, case.place, case.severity)
    return [f for f in check_pdo(proposal) if (f.rule, f.place, f.severity) == wanted]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_finding_names_rule_place_reason_and_abort(case: Case) -> None:
    proposal = proposed(case, DirectSdo(booted(case.family)))
    (finding, *_) = found(case, proposal)
    assert finding.text
    assert finding.abort == case.abort


@pytest.mark.parametrize("case", [case for case in CASES if case.severity is ERROR], ids=str)
def test_the_device_answers_what_the_finding_says(case: Case) -> None:
    sdo = DirectSdo(booted(case.family))
    proposal = proposed(case, sdo)
    (finding, *_) = found(case, proposal)
    code = None
    try:
        for step in plan_pdo(proposal.pdo, proposal.now, proposal.want).steps:
            sdo.download(step.index, step.sub_index, step.after)
    except SdoAborted as aborted:
        code = aborted.code
    assert code == finding.abort


def test_an_unchanged_pdo_has_no_finding() -> None:
    for family in ("generic", "gen4", "espac", "tmcm", "roboteq"):
        sdo = DirectSdo(booted(family))
        held = {one: read_pdo(sdo, one) for one in present_pdos(sdo, dictionary(family))}
        for pdo, config in held.items():
            others = {one: other for one, other in held.items() if one != pdo}
            assert check_pdo(Proposal(NODE, pdo, config, config, others, profile(family), dictionary(family))) == ()

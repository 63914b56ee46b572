"""The checker and the device, written apart, agree: what passes is taken, what is refused was foreseen."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from dvtcli.device.read_pdos import present_pdos, read_pdo
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import plan_pdo
from dvtcli.domain.rules import Proposal, check_pdo, errors_in
from dvtcli.errors import SdoAborted
from tests.laws.bench import FAMILIES, NODE, DirectSdo, booted, dictionary, profile
from tests.laws.configurations import legal, wild

laws = settings(max_examples=settings().max_examples, deadline=None, suppress_health_check=[HealthCheck.too_slow])
families = pytest.mark.parametrize("family", FAMILIES)


def aborted_by(sdo: DirectSdo, pdo: Pdo, now: PdoConfig, want: PdoConfig) -> int | None:
    """The abort code of the device's first refusal while *want* is forced on it, None where it takes all."""
    try:
        for step in plan_pdo(pdo, now, want).steps:
            sdo.download(step.index, step.sub_index, step.after)
    except SdoAborted as aborted:
        return aborted.code
    return None


def draw_pdo(data: st.DataObject, family: str) -> tuple[DirectSdo, Pdo, PdoConfig, dict[Pdo, PdoConfig]]:
    """A device, one of its PDOs with what it holds, and the other PDOs."""
    sdo = DirectSdo(booted(family))
    held = {pdo: read_pdo(sdo, pdo) for pdo in present_pdos(sdo, dictionary(family))}
    pdo = data.draw(st.sampled_from(list(held)))
    return sdo, pdo, held[pdo], {other: config for other, config in held.items() if other != pdo}


def proposed(family: str, pdo: Pdo, now: PdoConfig, want: PdoConfig, others: dict[Pdo, PdoConfig]) -> Proposal:
    return Proposal(NODE, pdo, now, want, others, profile(family), dictionary(family))


@families
@laws
@given(data=st.data())
def test_what_the_rules_let_pass_is_never_aborted(family: str, data: st.DataObject) -> None:
    sdo, pdo, now, others = draw_pdo(data, family)
    want = data.draw(st.one_of(legal(family, pdo, now), wild(family, pdo, now)))
    assume(not errors_in(check_pdo(proposed(family, pdo, now, want, others))))
    assert aborted_by(sdo, pdo, now, want) is None
    assert read_pdo(sdo, pdo) == want


@families
@laws
@given(data=st.data())
def test_what_the_device_aborts_was_foreseen_with_that_code(family: str, data: st.DataObject) -> None:
    sdo, pdo, now, others = draw_pdo(data, family)
    want = data.draw(wild(family, pdo, now))
    code = aborted_by(sdo, pdo, now, want)
    assume(code is not None)
    findings = errors_in(check_pdo(proposed(family, pdo, now, want, others)))
    assert code in {finding.abort for finding in findings}, [(f.rule, f.place, f.text) for f in findings]


@families
@laws
@given(data=st.data())
def test_configurations_that_are_legal_by_construction_pass(family: str, data: st.DataObject) -> None:
    """A rule that refuses what every device takes is as wrong as one that is missing."""
    sdo, pdo, now, others = draw_pdo(data, family)
    want = data.draw(legal(family, pdo, now))
    if aborted_by(sdo, pdo, now, want) is None:
        findings = errors_in(check_pdo(proposed(family, pdo, now, want, others)))
        assert not [f for f in findings if f.abort is not None], findings

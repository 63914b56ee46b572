"""What the device's file says of each object that a change writes: access, length, limits."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.datatypes import BY_SHORT_NAME
from dvtcli.domain.object_dictionary import Access, ObjectDictionary
from dvtcli.domain.profile import GENERIC
from dvtcli.domain.rules import Finding, Proposal, check_pdo
from tests.domain.rules.test_edges import limited, mapped, parameter, proposal, rules
from tests.laws.bench import dictionary

TOO_LONG, TOO_SHORT = 0x0607_0012, 0x0607_0013
U8, U32 = BY_SHORT_NAME["u8"], BY_SHORT_NAME["u32"]


def described(sub_index: int, **values: object) -> ObjectDictionary:
    """The generic dictionary with other *values* for a sub-index of TPDO1's mapping."""
    held = dictionary("generic")[0x1A00]
    entries = {**held.entries, sub_index: replace(held.entries[sub_index], **values)}  # type: ignore[arg-type]
    info = dictionary("generic").info
    return ObjectDictionary({**dictionary("generic"), 0x1A00: replace(held, entries=entries)}, info, "other.eds")


def said(asked: Proposal, rule: str) -> list[Finding]:
    return [finding for finding in check_pdo(asked) if finding.rule == rule]


def test_an_object_that_is_written_twice_is_told_once() -> None:
    asked = proposal(described=parameter(1, access=Access.RO), cob_id=CobId(0x190, rtr_allowed=False))
    on = asked.now.with_parameters(cob_id=CobId(0x181, rtr_allowed=False))
    (finding,) = said(replace(asked, now=on), "parameter-static")
    assert (
        typed(finding.hint)
        == "this device fixes it: what needs the PDO off or on cannot be changed; --off leaves one off"
    )
    (timer,) = said(proposal(described=parameter(5, access=Access.RO), event_timer=9), "parameter-static")
    assert typed(timer.hint) == "this device fixes it; leave the option out"


@pytest.mark.parametrize(
    ("sub_index", "text"),
    [
        (0, "number of mapped objects of TPDO1 is wo in other.eds"),
        (1, "mapping entry 1 of TPDO1 is wo in other.eds"),
    ],
)
def test_what_cannot_be_read_back_is_not_written(sub_index: int, text: str) -> None:
    asked = mapped(proposal(described=described(sub_index, access=Access.WO, line=None)), (0x6041, 0, 16))
    (finding,) = said(asked, "parameter-unreadable")
    assert finding.text == f"{text}: what it holds then cannot be read back"
    filled = replace(asked, profile=replace(GENERIC, filler=5))  # no count is written there
    assert len(said(filled, "parameter-unreadable")) == sub_index


@pytest.mark.parametrize(
    ("kind", "abort", "text"),
    [
        (U8, TOO_LONG, "event timer of TPDO1 has 8 bits in other.eds, CiA 301 has 16"),
        (U32, TOO_SHORT, "event timer of TPDO1 has 32 bits in other.eds, CiA 301 has 16"),
    ],
)
def test_a_parameter_of_another_length_is_refused(kind: object, abort: int, text: str) -> None:
    (finding,) = check_pdo(proposal(described=parameter(5, data_type=kind, line=None), event_timer=9))
    assert (finding.rule, finding.abort, finding.text) == ("parameter-length", abort, text)
    assert typed(finding.hint) == "if the file is wrong, correct it or give another file: --eds FILE"


def test_a_parameter_without_a_type_is_not_measured() -> None:
    assert rules(proposal(described=parameter(5, data_type=None, low=10, high=20), event_timer=9)) == []


def test_limits_that_the_type_cannot_have_do_not_count() -> None:
    assert rules(proposal(described=limited(10, 0x1_0000), event_timer=9)) == []
    assert rules(proposal(described=limited(10, 0xFFFF), event_timer=9)) == ["parameter-range"]

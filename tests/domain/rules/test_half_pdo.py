"""A PDO without COB-ID or without mapping: what of it can be changed, and what cannot."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.pdo import PdoMappingEntry
from dvtcli.domain.rules import Finding, Proposal, check_pdo
from tests.domain.rules.test_edges import parameter, proposal

STATUSWORD = PdoMappingEntry(0x6041, 0, 16)
NO_OBJECT = 0x0602_0000
UNKNOWN = "it is not known whether TPDO1 is off: 0x1800:01 cannot be read"


def half(asked: Proposal, *unread: tuple[int, int]) -> Proposal:
    """*asked* of a device that does not tell the objects *unread*, nothing of which changes."""
    held = replace(asked.now.disabled(), mapping=(), unread=unread)
    return replace(asked, now=held, want=held)


def said(asked: Proposal) -> list[Finding]:
    return [one for one in check_pdo(asked) if one.rule == "half-pdo"]


def mapped(asked: Proposal) -> Proposal:
    return replace(asked, want=replace(asked.now, mapping=(STATUSWORD,)))


def test_without_a_mapping_nothing_is_mapped() -> None:
    asked = half(proposal(), (0x1A00, 0))
    assert said(asked) == []
    (finding,) = said(mapped(asked))
    assert (finding.text, finding.abort) == (
        "TPDO1 of this device has no mapping: 0x1A00:00 cannot be read", NO_OBJECT,
    )  # fmt: skip
    assert typed(finding.hint) == "choose another PDO (`pdo --all`); `disable tpdo1` switches this one off"


def test_without_a_cob_id_it_is_not_enabled() -> None:
    asked = half(proposal(described=parameter(1)), (0x1800, 1))
    communication = asked.now.communication
    on = replace(asked.now, communication=replace(communication, cob_id=communication.cob_id.enabled()))
    finding = said(replace(asked, want=on))[0]
    assert (finding.text, finding.abort) == ("TPDO1 of this device has no COB-ID: 0x1800:01 cannot be read", NO_OBJECT)
    timed = replace(asked.now, communication=replace(communication, event_timer=9))
    assert said(replace(asked, want=timed)) == []


@pytest.mark.parametrize(
    ("described", "unknown"),
    [
        (parameter(1, name="COB-ID"), True),  # the file has it, so that it may well be enabled
        (parameter(1), False),  # the file has none
        (None, False),
    ],
)
def test_only_what_is_surely_off_is_mapped(described: object, unknown: bool) -> None:
    asked = replace(half(proposal(), (0x1800, 1)), dictionary=described)  # type: ignore[arg-type]
    assert [finding.text for finding in said(mapped(asked))] == ([UNKNOWN] if unknown else [])
    assert [(one.text, one.place, one.abort) for one in said(asked)] == [(UNKNOWN, "0x1800:01", None)]

"""What is left of a PDO that a device does not take back: the most that it takes, and in words what that is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.object_dictionary import Access
from dvtcli.domain.pdo import PdoConfig, PdoMappingEntry
from dvtcli.domain.profile import GENERIC, Severity
from dvtcli.domain.rules import Proposal, check_pdo
from dvtcli.domain.rules.no_way_back import substitute_finding, way_back
from tests.domain.rules.test_edges import TPDO1, parameter, proposal

STATUSWORD, NOWHERE = PdoMappingEntry(0x6041, 0, 16), PdoMappingEntry(0x5FFF, 0, 16)


def cob(can_id: int, *, valid: bool = True) -> CobId:
    return CobId(can_id, valid=valid, rtr_allowed=False)


def back_to(*entries: PdoMappingEntry, held_count: int | None = None, **parameters: object) -> Proposal:
    """From an enabled TPDO1 with the Statusword, type 254 and an inhibit time of 1 ms back to what it holds."""
    asked = proposal()
    set_to = replace(asked.now.communication, cob_id=cob(0x190), transmission_type=254, inhibit_time=10, event_timer=0)
    held = replace(set_to, **parameters)  # type: ignore[arg-type]
    unread = ((0x1A00, len(entries) + 1),) if held_count is not None else ()
    want = PdoConfig(held, entries, held_count=held_count, unread=unread)
    return replace(asked, now=PdoConfig(set_to, (STATUSWORD,)), want=want, others={}, profile=GENERIC)


@pytest.mark.parametrize(
    ("back", "was", "left"),
    [
        (back_to(STATUSWORD, transmission_type=245),
         "enabled and at transmission type 245", "at transmission type 254"),
        (back_to(STATUSWORD, transmission_type=245, event_timer=7),
         "enabled and at transmission type 245", "at transmission type 254"),
        (back_to(STATUSWORD, cob_id=cob(0x101)), "enabled", "off"),
        (back_to(STATUSWORD, cob_id=cob(0x101), transmission_type=245),
         "enabled and at transmission type 245", "off and at transmission type 254"),
        (back_to(), "enabled and empty", "off and empty"),
        (back_to(NOWHERE), "enabled", "off and empty"),
        (back_to(NOWHERE, cob_id=cob(0x190, valid=False)), "off", "off and empty"),
        (back_to(STATUSWORD, cob_id=cob(0x801), inhibit_time=20),
         "enabled and at inhibit time 20", "off and empty and at inhibit time 10"),
        (back_to(STATUSWORD, held_count=3), "inconsistent", "off and empty"),
    ],
)  # fmt: skip
def test_the_most_that_a_device_takes_is_put_back_and_said(back: Proposal, was: str, left: str) -> None:
    found = way_back(back)
    assert found is not None
    taken, warned = found
    assert (warned.rule, warned.severity) == ("way-back", Severity.WARNING)
    assert warned.text.startswith(f"TPDO1 is {was} now, and a device may refuse that configuration (")
    assert warned.text.endswith(f": if it does, an undo leaves it {left}")
    assert [one for one in check_pdo(replace(back, want=taken)) if one.severity is Severity.ERROR] == []
    after = substitute_finding(TPDO1, back.want, taken)
    assert after.place == "0x1800:01"
    assert after.text == f"TPDO1 was {was}, and the device refuses that configuration: it is {left} now"


def test_what_a_device_takes_back_needs_no_word() -> None:
    assert way_back(back_to(STATUSWORD, transmission_type=1, cob_id=cob(0x191))) is None
    clash = replace(back_to(STATUSWORD, cob_id=cob(0x080)))  # ours forbid it, no device does
    assert [one.rule for one in check_pdo(clash)] == ["can-id-in-use"]
    assert way_back(clash) is None


def test_what_can_neither_be_put_back_nor_be_switched_off_is_an_error() -> None:
    back = replace(back_to(STATUSWORD, cob_id=cob(0x191)), dictionary=parameter(1, access=Access.RO))
    found = way_back(back)
    assert found is not None
    taken, refused = found
    assert taken == back.want
    assert (refused.rule, refused.severity, refused.place) == ("no-way-back", Severity.ERROR, "0x1800:01")
    assert refused.text.startswith(
        "TPDO1 could neither be rolled back after this, nor be switched off and emptied: COB-ID of"
    )
    assert typed(refused.hint) == "choose another PDO (`pdo --all`)"

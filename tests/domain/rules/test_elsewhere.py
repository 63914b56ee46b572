"""CAN-IDs that other nodes of the network use: what they are known to send, and what is theirs by default."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.profile import Severity
from dvtcli.domain.rules import Proposal, check_pdo
from dvtcli.domain.rules.can_id import automatic_can_id
from dvtcli.domain.rules.finding import Producer
from tests.domain.rules.test_edges import RPDO1, TPDO1, TPDO2, proposal
from tests.laws.bench import NODE

OTHER = 5
#: the default of TPDO2 of node 5
THEIRS = 0x280 + OTHER


def beside(*producers: Producer, pdo: Pdo = TPDO1, can_id: int = THEIRS, extended: bool = False) -> Proposal:
    """*pdo* is to use *can_id*, beside nodes that send what *producers* say."""
    asked = proposal(pdo, cob_id=CobId(can_id, rtr_allowed=False, extended=extended))
    return replace(asked, elsewhere=lambda: producers)


def sends(can_id: int, *, pdo: Pdo = TPDO2, extended: bool = False) -> Producer:
    return Producer(OTHER, pdo, CobId(can_id, extended=extended))


def said(asked: Proposal) -> list[tuple[str, Severity]]:
    return [(finding.rule, finding.severity) for finding in check_pdo(asked) if finding.rule.startswith("can-id")]


def test_what_another_node_sends_is_no_can_id_of_ours() -> None:
    asked = beside(sends(THEIRS))
    assert said(asked) == [("can-id-clash", Severity.ERROR)]
    (finding,) = (finding for finding in check_pdo(asked) if finding.rule == "can-id-clash")
    assert f"is already sent by TPDO2 of node {OTHER}" in finding.text
    assert f"`disable {OTHER}:tpdo2` first" in typed(finding.hint)


def test_what_nobody_is_seen_to_send_is_only_somebody_s_default() -> None:
    default = [("can-id-default", Severity.NOTE)]
    assert said(beside()) == default
    assert said(beside(sends(THEIRS + 1))) == default
    assert said(beside(sends(THEIRS, extended=True))) == default
    assert said(beside(sends(THEIRS, pdo=TPDO1))) == [("can-id-clash", Severity.ERROR), *default]


def test_what_another_node_sends_is_there_to_be_received() -> None:
    assert said(beside(sends(THEIRS), pdo=RPDO1)) == []


def test_a_consumer_of_what_its_owner_does_not_send_is_told_whose_default_it_is() -> None:
    default = [("can-id-default", Severity.NOTE)]
    assert said(beside(pdo=RPDO1)) == default
    assert said(beside(sends(THEIRS, pdo=TPDO1), pdo=RPDO1)) == []
    assert said(beside(sends(THEIRS, extended=True), pdo=RPDO1)) == default


def test_29_bits_of_the_same_number_are_another_can_id() -> None:
    assert said(beside(sends(THEIRS), extended=True)) == []
    assert said(beside(sends(THEIRS, extended=True), extended=True)) == [("can-id-clash", Severity.ERROR)]


def test_an_automatic_can_id_is_none_that_another_node_sends() -> None:
    ours = 0x180 + NODE
    assert automatic_can_id(beside()) == ours
    assert automatic_can_id(beside(sends(ours))) not in (None, ours)
    assert automatic_can_id(beside(sends(0x200 + NODE), pdo=RPDO1)) == 0x200 + NODE


@pytest.mark.parametrize(("can_id", "text"), [(0x081 + NODE, "EMCY of node 2"), (0x0FF, "EMCY of node 127"),
                                              (0x100, "TIME by default")])  # fmt: skip
def test_a_service_s_default_is_told(can_id: int, text: str) -> None:
    (finding,) = check_pdo(beside(can_id=can_id))
    assert (finding.rule, finding.severity) == ("can-id-in-use", Severity.WARNING)
    assert text in finding.text

"""An RPDO that waits for what nobody sends: a warning where it begins to wait, and only there."""

from __future__ import annotations

import pytest

from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.network.consumers import producer_findings, sent_by
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, plan_pdo
from tests.laws.bench import DirectSdo, booted

OFF, LIVE, MOVED, EXTENDED = CobId(0x201, valid=False), CobId(0x201), CobId(0x190), CobId(0x201, extended=True)


def config(cob_id: CobId) -> PdoConfig:
    held = read_pdo(DirectSdo(booted()), Pdo.parse("rpdo1"))
    return held.with_parameters(cob_id=cob_id)


def change(before: CobId, after: CobId, pdo: str = "rpdo1") -> PdoChange:
    return plan_pdo(Pdo.parse(pdo), config(before), config(after))


@pytest.mark.parametrize(
    ("made", "sent", "warned"),
    [
        (change(OFF, LIVE), (), True),
        (change(OFF, LIVE), (LIVE,), False),
        (change(OFF, LIVE), (MOVED,), True),
        (change(OFF, LIVE), (EXTENDED,), True),
        (change(OFF, LIVE), (OFF,), True),
        (change(LIVE, MOVED), (LIVE,), True),
        (change(LIVE, MOVED), (MOVED,), False),
        (change(LIVE, LIVE), (), False),
        (change(LIVE, OFF), (), False),
        (change(OFF, LIVE, "tpdo1"), (), False),
    ],
)
def test_who_waits_in_vain(made: PdoChange, sent: tuple[CobId, ...], warned: bool) -> None:
    findings = list(producer_findings([made], set(sent_by(config(one) for one in sent)), "it waits for ever"))
    assert [(finding.rule, finding.place) for finding in findings] == [("rpdo-producer", "0x1400:01")] * warned
    assert all("it waits for ever" in finding.text for finding in findings)


def test_one_warning_for_each() -> None:
    changes = [change(OFF, LIVE, "tpdo1"), change(OFF, LIVE), change(OFF, MOVED, "rpdo2")]
    assert [finding.place for finding in producer_findings(changes, (), "")] == ["0x1400:01", "0x1401:01"]

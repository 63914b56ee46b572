"""A TPDO that answers remote frames: bit 30 is cleared before the type that needs it, or a device refuses the type."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import plan_pdo
from tests.laws.bench import DirectSdo, booted

TPDO1 = Pdo.parse("tpdo1")


def config(now: PdoConfig, cob_id: int, transmission_type: int) -> PdoConfig:
    communication = replace(now.communication, cob_id=CobId.from_raw(cob_id), transmission_type=transmission_type)
    return replace(now, communication=communication)


@pytest.mark.parametrize("kind", [252, 253])
@pytest.mark.parametrize(
    ("held", "disabling"), [(0x4000_0181, [("1800:01", "0xC0000181")]), (0xC000_0181, [])], ids=["on", "off"]
)
def test_rtr_is_allowed_before_the_type_that_answers_it(kind: int, held: int, disabling: list[tuple[str, str]]) -> None:
    sdo = DirectSdo(booted())
    start = config(read_pdo(sdo, TPDO1), held, 254)
    for step in plan_pdo(TPDO1, read_pdo(sdo, TPDO1), start).steps:
        sdo.download(step.index, step.sub_index, step.after)
    want = config(start, 0x0000_0181, kind)
    steps = plan_pdo(TPDO1, start, want).steps
    assert [(step.object, f"0x{int.from_bytes(step.after, 'little'):08X}") for step in steps] == [
        *disabling,
        ("1800:01", "0x80000181"),
        ("1800:02", f"0x{kind:08X}"),
        ("1800:01", "0x00000181"),
    ]
    for step in steps:
        assert step.before == sdo.upload(step.index, step.sub_index)
        sdo.download(step.index, step.sub_index, step.after)  # the strict device takes each of them
    assert read_pdo(sdo, TPDO1) == want


@pytest.mark.parametrize(
    ("now", "want"),
    [
        ((0x4000_0181, 254), (0x0000_0181, 1)),  # another type needs no RTR
        ((0x4000_0181, 252), (0x0000_0181, 252)),  # held already
        ((0x0000_0181, 254), (0x0000_0190, 252)),  # allowed already
        ((0x4000_0181, 254), (0x4000_0190, 252)),  # not wanted: refused by the rules
    ],
)
def test_otherwise_the_cob_id_is_written_once_to_disable_and_once_to_enable(
    now: tuple[int, int], want: tuple[int, int]
) -> None:
    base = read_pdo(DirectSdo(booted()), TPDO1)
    steps = plan_pdo(TPDO1, config(base, *now), config(base, *want)).steps
    written = [int.from_bytes(step.after, "little") for step in steps if step.object == "1800:01"]
    assert written == [now[0] | 0x8000_0000, want[0]]
    assert steps[-1].reason == f"COB-ID 0x{want[0] & 0x7FF:03X}, enable"


def test_a_step_says_where_it_leads() -> None:
    base = read_pdo(DirectSdo(booted()), TPDO1)
    (step,) = plan_pdo(TPDO1, config(base, 0xC000_0181, 1), config(base, 0xC000_0190, 1)).steps
    assert step.reason == "COB-ID 0x190, stays disabled"

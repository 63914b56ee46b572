"""The order of values that depend on each other: what a service uses is released before it changes."""

from __future__ import annotations

import pytest

from dvtcli.domain.objects import COB_ID_EMCY, COB_ID_SYNC, COB_ID_TIME
from dvtcli.domain.plan import Step, order_of_dependent_values

PRODUCES, CONSUMES, OFF = 1 << 30, 1 << 31, 1 << 31


def step(index: int, before: int, after: int, sub_index: int = 0) -> Step:
    return Step(index, sub_index, before.to_bytes(4, "little"), after.to_bytes(4, "little"), "as wanted")


@pytest.mark.parametrize(
    ("index", "sub_index", "held", "wanted", "written"),
    [
        (COB_ID_TIME, 0, CONSUMES | 0x100, CONSUMES | 0x101, [0x100, CONSUMES | 0x101]),
        (COB_ID_TIME, 0, PRODUCES | 0x100, PRODUCES | 0x101, [0x100, PRODUCES | 0x101]),
        (COB_ID_TIME, 0, PRODUCES | CONSUMES | 0x100, 0x101, [0x100, 0x101]),
        (COB_ID_TIME, 0, CONSUMES | 0x100, PRODUCES | 0x100, [PRODUCES | 0x100]),
        (COB_ID_TIME, 0, 0x100, 0x101, [0x101]),
        (COB_ID_SYNC, 0, PRODUCES | 0x080, PRODUCES | 0x081, [0x080, PRODUCES | 0x081]),
        (COB_ID_SYNC, 0, 0x080, PRODUCES | 0x081, [PRODUCES | 0x081]),
        (COB_ID_EMCY, 0, 0x085, 0x086, [OFF | 0x085, 0x086]),
        (COB_ID_EMCY, 0, OFF | 0x085, 0x086, [0x086]),
        (0x1201, 1, 0x610, 0x611, [OFF | 0x610, 0x611]),
        (0x1201, 2, 0x590, OFF | 0x590, [OFF | 0x590]),
    ],
)
def test_a_service_that_uses_a_cob_id_stops_before_that_changes(
    index: int, sub_index: int, held: int, wanted: int, written: list[int]
) -> None:
    ordered = order_of_dependent_values([step(index, held, wanted, sub_index)])
    assert [int.from_bytes(one.after, "little") for one in ordered] == written

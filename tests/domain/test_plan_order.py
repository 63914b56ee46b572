"""The order of values that depend on each other: what a service uses is released before it changes."""

from __future__ import annotations

import pytest

from dvtcli.domain.plan import EMCY_COB_ID, SYNC_COB_ID, TIME_COB_ID, Step, order_of_dependent_values

PRODUCES, CONSUMES, OFF = 1 << 30, 1 << 31, 1 << 31


def step(index: int, before: int, after: int, sub_index: int = 0) -> Step:
    return Step(index, sub_index, before.to_bytes(4, "little"), after.to_bytes(4, "little"), "as wanted")


@pytest.mark.parametrize(
    ("index", "sub_index", "held", "wanted", "written"),
    [
        (TIME_COB_ID, 0, CONSUMES | 0x100, CONSUMES | 0x101, [0x100, CONSUMES | 0x101]),
        (TIME_COB_ID, 0, PRODUCES | 0x100, PRODUCES | 0x101, [0x100, PRODUCES | 0x101]),
        (TIME_COB_ID, 0, PRODUCES | CONSUMES | 0x100, 0x101, [0x100, 0x101]),
        (TIME_COB_ID, 0, CONSUMES | 0x100, PRODUCES | 0x100, [PRODUCES | 0x100]),
        (TIME_COB_ID, 0, 0x100, 0x101, [0x101]),
        (SYNC_COB_ID, 0, PRODUCES | 0x080, PRODUCES | 0x081, [0x080, PRODUCES | 0x081]),
        (SYNC_COB_ID, 0, 0x080, PRODUCES | 0x081, [PRODUCES | 0x081]),
        (EMCY_COB_ID, 0, 0x085, 0x086, [OFF | 0x085, 0x086]),
        (EMCY_COB_ID, 0, OFF | 0x085, 0x086, [0x086]),
        (0x1201, 1, 0x610, 0x611, [OFF | 0x610, 0x611]),
        (0x1201, 2, 0x590, OFF | 0x590, [OFF | 0x590]),
    ],
)
def test_a_service_that_uses_a_cob_id_stops_before_that_changes(
    index: int, sub_index: int, held: int, wanted: int, written: list[int]
) -> None:
    ordered = order_of_dependent_values([step(index, held, wanted, sub_index)])
    assert [int.from_bytes(one.after, "little") for one in ordered] == written

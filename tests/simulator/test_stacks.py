"""The table of `stack_rows`, in one process: what families calibrated to public stacks answer."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.simulator.bench import InProcess, booted
from tests.simulator.stack_rows import CELLS, ROWS, Probe, Stack


@pytest.mark.drawn(20)
@pytest.mark.parametrize(("stack", "case", "wanted"), CELLS)
def test_cell(stack: Stack, case: Callable[[Probe], str], wanted: str) -> None:
    assert case(Probe(stack, InProcess(booted(stack.family, stack.node_id)))) == wanted


def test_every_row_is_here() -> None:
    named = (
        "A1 A2 A3 A4 B1 B2 B3 B3b B4 B5 B6 C1 C2 C3 C4 C5 C6 C7 C8 C9 C10 C11 C12 C13 C14 C15 C16 C17 D1 D2 D3 D4 "
        "E1 E2 E3 E4 E5 E6 E7 E8 E9 E10 F1 F2 F3 F4 F5 F6 G1 G2 H1 H2 H3 H4 H5 I1 I2 I2b I3 I4 J1 J2 J3 J4 J5"
    )
    assert set(ROWS) == set(named.split())

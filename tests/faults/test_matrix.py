"""A part of the fault matrix, another one in each run; `tests/benchmarks/fault_matrix.py` runs the whole of it."""

from __future__ import annotations

import pytest

from tests.faults.matrix import NEW, OLD, RECOVERED, TOLD, UNNOTICED, Cell, cells_of, groups, outcome
from tests.faults.sequences import AT_READ, FAMILIES, FAULTS, LASTING, Start
from tests.harness.sample import heavy, part

#: faults for each sequence in a long run
MANY = 12


@pytest.mark.counted
@pytest.mark.parametrize("group", groups(), ids=lambda group: "-".join(map(str, group)))
def test_every_fault_ends_old_or_new_or_can_be_finished(
    group: tuple[str, str, Start], request: pytest.FixtureRequest
) -> None:
    for cell in part(list(cells_of(*group)), request.config.getoption("--cells"), request.config, group):
        result = outcome(cell)
        fine = result in (OLD, NEW) or (result == RECOVERED and cell.fault in LASTING)
        assert fine or (result in (TOLD, UNNOTICED) and cell.fault in AT_READ), f"{cell}: {result}"


@pytest.mark.counted
def test_the_whole_matrix_has_at_least_5000_cells(request: pytest.FixtureRequest) -> None:
    if request.config.getoption("--cells") < MANY:
        pytest.skip(f"runs every sequence in every length: --cells {MANY} does")
    assert sum(len(list(cells_of(*group))) for group in groups()) >= 5000


def test_every_family_starts_in_every_state() -> None:
    for family in FAMILIES:
        assert len({start for one, _, start in groups() if one == family}) == 4


@pytest.mark.parametrize("fault", FAULTS)
def test_the_same_cell_ends_the_same(fault: str) -> None:
    cell = Cell("generic", "map-tpdo", Start(operational=True, modified=True), 5, fault)
    assert Cell.parse(str(cell)) == cell
    assert outcome(cell) == outcome(cell)


@heavy
def test_what_a_fault_of_each_kind_leaves() -> None:
    at = ("gen4", "map-tpdo", Start(operational=True, modified=True), 5)
    assert {fault: outcome(Cell(*at, fault)) for fault in ("refuse", "lose-response", "reset-0.6s")} == {
        "refuse": OLD,
        "lose-response": OLD,
        "reset-0.6s": OLD,
    }
    assert {outcome(Cell(*at, fault)) for fault in ("duplicate", "foreign", "late-0.3s", "toggle")} == {NEW}
    assert {outcome(Cell(*at, fault)) for fault in ("silent", "power-loss", "bus-error")} == {RECOVERED}

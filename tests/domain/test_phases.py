"""A network's plan in phases: the same writes, in an order in which no RPDO hears what it is not mapped for."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.network.network_plan import phases
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig
from dvtcli.domain.plan import PdoChange, Plan, Step, ValueChange, plan_pdo
from tests.domain.configs import config_pairs

TPDO, RPDO = Pdo.parse("tpdo1"), Pdo.parse("rpdo2")
Key = tuple[int, Pdo]


@st.composite
def plans(draw: st.DrawFn) -> list[Plan]:
    """Two nodes, of each a TPDO and an RPDO that change somehow, or not at all."""
    found = []
    for node_id in (1, 5):
        changes = [plan_pdo(pdo, *draw(config_pairs())) for pdo in (TPDO, RPDO)]
        found.append(Plan(node_id, tuple(change for change in changes if change.steps)))
    return found


def of_pdos(made: list[Plan]) -> dict[Key, PdoChange]:
    return {(plan.node_id, one.pdo): one for plan in made for one in plan.changes if isinstance(one, PdoChange)}


@given(plans())
def test_the_phases_together_are_the_plan(made: list[Plan]) -> None:
    parts: dict[Key, list[PdoChange]] = {key: [] for key in of_pdos(made)}
    for phase in phases(made):
        for key, part in of_pdos(list(phase)).items():
            parts[key].append(part)
    for key, change in of_pdos(made).items():
        assert [step for part in parts[key] for step in part.steps] == list(change.steps)
        assert [part.before for part in parts[key]] + [change.after] == [change.before] + [
            part.after for part in parts[key]
        ]


@given(plans())
def test_nothing_that_a_frame_depends_on_is_written_while_such_a_pdo_is_on(made: list[Plan]) -> None:
    held = {key: change.before for key, change in of_pdos(made).items()}
    for number, phase in enumerate(phases(made)):
        now = {key: change for key, change in of_pdos(made).items() if _moves(change)}
        for key, part in of_pdos(list(phase)).items():
            if part.before.mapping != part.after.mapping:
                assert number == 2
                assert not any(held[one].enabled for one in now)
            held[key] = part.after
    assert held == {key: change.after for key, change in of_pdos(made).items()}


def _moves(change: PdoChange) -> bool:
    """Whether the frames of the PDO get another layout, or another COB-ID."""
    before, after = change.before, change.after
    return before.mapping != after.mapping or before.communication.cob_id != after.communication.cob_id


def test_consumers_are_disabled_after_producers_and_enabled_before_them() -> None:
    one, other = (PdoConfig(PdoCommunicationParameter(CobId(can_id), 255), ()) for can_id in (0x181, 0x201))
    made = [Plan(1, (plan_pdo(TPDO, one, other),)), Plan(5, (plan_pdo(RPDO, one, other),))]
    order = [[(node_id, str(pdo)) for node_id, pdo in of_pdos(list(phase))] for phase in phases(made)]
    assert order == [[(1, "tpdo1")], [(5, "rpdo2")], [], [(5, "rpdo2")], [(1, "tpdo1")]]


def test_single_objects_are_written_with_the_rest() -> None:
    value = ValueChange(Step(0x1017, 0, b"\0\0", b"\1\0", "write"))
    assert phases([Plan(1, (value,))]) == ((), (), (Plan(1, (value,)),), (), ())

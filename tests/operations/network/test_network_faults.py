"""A fault at every step of a plan for three nodes: every node that can be reached holds what it held, or it is said."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged
from tests.operations.network.bench import CHAIN, FILE, Chain
from tests.surroundings import HOMES

pytestmark = pytest.mark.drawn(7, "network faults")

OPERATIONAL = dict.fromkeys(CHAIN, NmtState.OPERATIONAL)


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for folder in ("ideal", "home"):  # what is kept of one bus must not be found on the other
        for name in HOMES:
            monkeypatch.setenv(name, str(tmp_path / folder))
        ideal()


@lru_cache
def ideal() -> tuple[dict[int, int], frozenset[object]]:
    """How many downloads each node sees where nothing goes wrong, and which layouts meet before and after."""
    with TemporaryDirectory() as folder:
        chain = Chain(Path(folder), [f"{node_id}:slow-store=0" for node_id in CHAIN])
        before = chain.fitting()
        assert chain.apply().plan.writes == sum(chain.downloads().values())
        chain.wait(1.0)
        after = chain.fitting()
        assert {consumer for _, _, consumer, _ in chain.bus.layouts} == {1, 5}, "frames are heard"
        return chain.downloads(), frozenset(before | after)


#: a refusal that no NMT state explains: at 0x08000000 a running node is asked again in PRE-OPERATIONAL
FAULTS = ("refuse@{}=0x06090030", "reset@{}", "lose-response@{}", "silent@{}")
STEPS = [(node_id, step) for node_id, most in {1: 13, 5: 19, 9: 9}.items() for step in range(1, most + 1)]


def test_every_step_is_tried() -> None:
    assert [(node_id, step) for node_id, most in ideal()[0].items() for step in range(1, most + 1)] == STEPS


def test_a_network_gets_what_its_file_says_and_stays_operational(tmp_path: Path) -> None:
    chain = Chain(tmp_path)
    before = chain.held()
    assert chain.apply()
    assert chain.held() != before
    assert not chain.plan().plan.changed
    assert chain.apply().plan.writes == 0
    assert chain.states() == OPERATIONAL
    assert chain.journals() == []
    assert chain.bus.layouts <= ideal()[1]


#: Every step of every node with one of the faults by turns: all of them with all take a minute.
CELLS = [(FAULTS[number % len(FAULTS)], *step) for number, step in enumerate(STEPS)]


@pytest.mark.drawn(9)
@pytest.mark.parametrize(("fault", "node_id", "step"), [cell for cell in CELLS if cell[0] != FAULTS[-1]])
def test_a_node_that_recovers_takes_every_node_back(fault: str, node_id: int, step: int, tmp_path: Path) -> None:
    chain = Chain(tmp_path, [f"{node_id}:{fault.format(step)}"])
    before, stored = chain.held(), chain.stored()
    with pytest.raises(DvtcliError) as raised:
        chain.apply()
    assert raised.value.exit_code in (1, 5), (raised.value, raised.value.why, raised.value.details)
    assert raised.value.state == "rolled_back"
    assert (chain.held(), chain.stored(), chain.journals()) == (before, stored, [])
    assert chain.states() == OPERATIONAL
    assert chain.bus.layouts <= ideal()[1], "no RPDO heard a layout that it was not mapped for"


@pytest.mark.drawn(4)
@pytest.mark.parametrize(("node_id", "step"), [cell[1:] for cell in CELLS if cell[0] == FAULTS[-1]])
def test_a_node_that_dies_leaves_its_journal_and_the_others_as_they_were(
    node_id: int, step: int, tmp_path: Path
) -> None:
    chain = Chain(tmp_path, [f"{node_id}:silent@{step}"])
    before, stored = chain.held(), chain.stored()
    with pytest.raises(LeftChanged) as raised:
        chain.apply()
    assert (raised.value.node, raised.value.exit_code) == (node_id, 7)
    (journal,) = chain.journals()
    assert raised.value.place == str(journal)
    others = {other for other in CHAIN if other != node_id}
    assert {other: chain.held()[other] for other in others} == {other: before[other] for other in others}
    assert chain.stored() == stored
    received = {one for one in chain.bus.layouts if one[2] != node_id}  # a dead node hears nothing
    assert received <= ideal()[1]


TWO = """nodes:
  first: {node_id: 5, tpdo: {1: {transmission: 1}}}
  second: {node_id: 6, tpdo: {1: {transmission: 1, event_timer: 100, mapping: [6041, 6064]}}}
"""


@pytest.mark.drawn(6)
@pytest.mark.parametrize("silently", [[], ["5:no-boot-up"]])
@pytest.mark.parametrize("read", range(5, 14))
def test_a_node_that_restarts_once_it_was_verified_takes_every_node_back(
    read: int, silently: list[str], tmp_path: Path
) -> None:
    file = tmp_path / "two.yaml"
    file.write_text(TWO)
    chain = Chain(tmp_path, [f"5:reset-after-read@{read}", *silently], families={5: "generic", 6: "generic"})
    before, stored = chain.held(), chain.stored()
    with pytest.raises(DvtcliError) as raised:
        chain.apply(file)
    assert (raised.value.exit_code, raised.value.state) == (1, "rolled_back")
    assert (chain.held(), chain.stored(), chain.journals()) == (before, stored, [])


#: The download of node 9 after whose read it restarts, once verified: it saves by itself, and refuses to start again.
@pytest.mark.parametrize("step", [4, 5])
def test_a_part_that_was_verified_is_taken_back_where_its_nmt_state_is_not_to_be_had(step: int, tmp_path: Path) -> None:
    faults = ["9:saves-itself", f"9:reset-after-read@{step}=0.001"]
    chain = Chain(tmp_path, faults, families={5: "generic", 9: "generic"})
    chain.devices[9].ignores_nmt = True
    file = tmp_path / "both.yaml"
    file.write_text("defaults: {tpdo: {1: {transmission: 1}}}\nnodes: {a: {node_id: 5}, b: {node_id: 9}}\n")
    before = {node_id: one.value(0x1800, 2) for node_id, one in chain.devices.items()}
    with pytest.raises(DeviceRefused) as raised:
        chain.apply(file)
    assert {node_id: one.value(0x1800, 2) for node_id, one in chain.devices.items()} == before
    assert chain.states()[9] is NmtState.PRE_OPERATIONAL, "the fault that is told"
    assert (raised.value.exit_code, raised.value.node, raised.value.state) == (1, 9, "rolled_back")
    assert "NMT state of node 9" in (raised.value.state_text or "")
    assert chain.journals() == []


def storing(folder: Path) -> Path:
    """The example, with a store on every node."""
    file = folder / "stores.yaml"
    file.write_text("defaults: {store: true}\n" + FILE.read_text("utf-8"))
    return file


@pytest.mark.parametrize(("node_id", "stored"), [(1, [5, 9]), (5, [1, 9]), (9, [1, 5])])
def test_a_store_that_fails_names_who_has_stored_and_takes_nothing_back(
    node_id: int, stored: list[int], tmp_path: Path
) -> None:
    chain = Chain(tmp_path, [f"{node_id}:store-fails"])
    before = chain.stored()
    with pytest.raises(LeftChanged) as raised:
        chain.apply(storing(tmp_path))
    error = raised.value
    assert (error.exit_code, error.node, error.state) == (7, node_id, "left_changed")
    told = dict(error.details)
    assert told.get("stored") == f"nodes {stored[0]} and {stored[1]}"
    assert str(node_id) in told.get("not stored", "") + told.get("unknown", "")
    assert [one for one in CHAIN if chain.stored()[one] != before[one]] == stored
    assert not chain.plan().plan.changed, "every node has the planned values"
    assert len(chain.journals()) == len(CHAIN), "recover goes on, or back"
    assert chain.states() == {**OPERATIONAL, 1: NmtState.PRE_OPERATIONAL}, "what left OPERATIONAL stays where it is"


def test_stores_come_after_the_last_read_back_and_are_proved(tmp_path: Path) -> None:
    chain = Chain(tmp_path)
    done = chain.apply(storing(tmp_path), prove="reset")
    assert [one.proof is not None and one.proof.holds for one in done.stored] == [True] * 3
    chain.wait(0.0)
    chain.bus.send_nmt(NmtCommand.RESET_NODE, 0)
    chain.wait(1.0)
    assert not chain.plan().plan.changed

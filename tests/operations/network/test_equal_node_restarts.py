"""A node that is as the file says, in RAM only, and restarts while the plan stands: it is looked at again.

What it lost is told instead of a success; what it still holds is a success, for no more frames than that look.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.network.network_plan import NetworkPlan
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import DvtcliError, LeftChanged, SafetyRefusal
from dvtcli.operations.network.network_files import apply_file, plan_file
from dvtcli.operations.plans.link_pdos import link_pdos
from tests.harness.sample import heavy
from tests.operations.network.bench import Chain
from tests.operations.network.test_many_nodes import Unheard, written

#: node 6 holds it in RAM only, as `device` makes it
EQUAL = "  equal: {node_id: 6, tpdo: {1: {event_timer: 33}}}\n"
TO_WRITE = "nodes:\n  written: {node_id: 5, tpdo: {1: {event_timer: 20}}}\n" + EQUAL


def two(folder: Path, text: str = TO_WRITE) -> tuple[Chain, Path]:
    file = folder / "two.yaml"
    file.write_text(text)
    return Chain(folder, operational=False, families={5: "generic", 6: "generic"}, bus=Unheard), file


def restarting(chain: Chain, node_id: int = 6) -> Callable[[object], None]:
    """What restarts the node, once."""
    left = [node_id]

    def restart(_when: object) -> None:
        if left:
            chain.bus.send_nmt(NmtCommand.RESET_NODE, left.pop())

    return restart


def thinking(chain: Chain, node_id: int = 6) -> Callable[[object], None]:
    """What restarts the node, and then takes its time."""
    restart = restarting(chain, node_id)
    return lambda when: (restart(when), chain.bus.sleep(0.5))[1]


def apply(chain: Chain, file: Path, on_plan: Callable[[NetworkPlan], None] = lambda _plan: None) -> bool:
    with chain.session() as session:
        return bool(apply_file(session, str(file), on_plan=on_plan))


def test_it_restarts_while_another_one_is_written(tmp_path: Path) -> None:
    chain, file = two(tmp_path)
    before = chain.held()[5]
    chain.bus.on_write = restarting(chain)  # type: ignore[attr-defined]
    with pytest.raises(DvtcliError) as raised:
        apply(chain, file)
    assert (raised.value.node, raised.value.state) == (6, "rolled_back")
    assert "restarted" in raised.value.text
    assert (chain.held()[5], chain.journals()) == (before, [])


@heavy
def test_it_restarts_and_holds_it_all_the_same(tmp_path: Path) -> None:
    chain, file = two(tmp_path)
    chain.devices[6]._memory.save(0x1800, 0x1800)
    chain.bus.on_write = restarting(chain)  # type: ignore[attr-defined]
    assert apply(chain, file)
    assert not chain.plan(file).plan.changed


@pytest.mark.parametrize("text", [TO_WRITE, "nodes:\n" + EQUAL])
def test_it_restarts_while_the_question_stands(tmp_path: Path, text: str) -> None:
    chain, file = two(tmp_path, text)
    with pytest.raises(SafetyRefusal) as raised:
        apply(chain, file, thinking(chain))
    assert (raised.value.node, raised.value.state, written(chain)) == (6, "unchanged", 0)  # type: ignore[comparison-overlap]
    assert not chain.plan(file).plan.nodes[-1].unchanged


def test_what_the_written_node_held_and_lost_is_looked_at_too(tmp_path: Path) -> None:
    chain, file = two(tmp_path, TO_WRITE.replace("{1:", "{2: {cob_id: 0x2A5}, 1:", 1))
    chain.devices[5]._memory.save(0x1800, 0x1800)
    chain.devices[5].download(0x1801, 1, (0x8000_02A5).to_bytes(4, "little"))
    assert {one.label for one in chain.plan(file).plan.nodes[0].plan.changes} == {"TPDO1"}
    with pytest.raises(SafetyRefusal) as raised:
        apply(chain, file, thinking(chain, 5))
    assert (raised.value.node, written(chain)) == (5, 0)


def test_a_link_of_nodes_that_are_linked(tmp_path: Path) -> None:
    chain, _ = two(tmp_path)
    ends = Endpoint(5, Pdo.parse("tpdo1")), [Endpoint(6, Pdo.parse("rpdo1"))]
    with chain.session() as session:
        assert link_pdos(session, *ends)
    with chain.session() as session, pytest.raises(SafetyRefusal):
        link_pdos(session, *ends, on_plan=thinking(chain))


def test_a_saved_plan_of_nothing(tmp_path: Path) -> None:
    chain, file = two(tmp_path, "nodes:\n" + EQUAL)
    saved = tmp_path / "plan.json"
    with chain.session() as session:
        plan_file(session, str(file), str(saved))
    with pytest.raises(SafetyRefusal):
        apply(chain, saved, thinking(chain))


def test_it_restarts_while_another_one_stores(tmp_path: Path) -> None:
    chain, file = two(tmp_path, TO_WRITE.replace("{node_id: 5,", "{node_id: 5, store: true,"))
    restart = restarting(chain)
    writes = chain.plan(file).plan.writes
    chain.bus.on_write = lambda count: restart(count) if count > writes else None  # type: ignore[attr-defined]
    with pytest.raises(LeftChanged) as raised:
        apply(chain, file)
    assert (raised.value.node, raised.value.state) == (6, "left_changed")
    assert raised.value.stores is not None
    assert raised.value.stores.stored == (5,)
    assert chain.stored()[5][0x1800, 5] == (20).to_bytes(2, "little"), "the store came first"
    assert chain.journals() == []


def test_a_trusted_stamp_does_not_outlive_a_restart(tmp_path: Path) -> None:
    chain, file = two(tmp_path, "defaults: {store: true, stamp: true}\n" + TO_WRITE)
    assert apply(chain, file)
    restart = thinking(chain)
    with chain.session() as session, pytest.raises(SafetyRefusal, match="restarted"):
        apply_file(session, str(file), trust_stamp=True, on_plan=restart)
    with chain.session() as session:
        done = apply_file(session, str(file), trust_stamp=True)
    assert done.plan.unread == (5, 6)

"""Nodes side by side within a phase: the same end as one after the other, in less time, and no less safe."""

from __future__ import annotations

import os
import shutil
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from dvtcli.errors import DvtcliError, Interrupted, LeftChanged, NoAnswer
from dvtcli.operations.exchange.import_network import import_network
from dvtcli.operations.network.network_files import apply_file
from dvtcli.operations.session.session import Session
from tests.harness.sample import heavy, part
from tests.operations.network.bench import CHAIN, FILE, Chain
from tests.operations.network.killed import Watched
from tests.operations.network.test_network_faults import FAULTS, STEPS, ideal


class OneByOne(Watched):
    most_at_once = 1


class Torn(Watched):
    """A bus on which whoever reads is torn apart at the read number *stops_at*."""

    reads, stops_at = 0, 0

    def send_sdo(self, can_id: int, data: bytes) -> None:
        if data[0] >> 5 == 2:
            self.reads += 1
            if self.reads == self.stops_at:
                raise KeyboardInterrupt
        super().send_sdo(can_id, data)


def chain(home: Path, name: str, faults: list[str] | None = None, bus: type[Watched] = Watched) -> Chain:
    """The network, with none of its nodes OPERATIONAL."""
    (home.parent / name).mkdir()
    return Chain(home.parent / name, faults, bus=bus, operational=False)


@heavy
def test_the_same_is_done_in_less_time(home: Path) -> None:
    ends = []
    for name, bus in (("one", OneByOne), ("all", Watched)):
        made = chain(home, name, bus=bus)
        began_s = made.bus.now_s()
        made.apply()
        ends.append((made.held(), made.bus.now_s() - began_s))
        assert made.journals() == []
        assert made.bus.layouts <= ideal()[1]
    (one, one_s), (together, together_s) = ends
    assert one == together
    assert together_s < 0.7 * one_s


@heavy
def test_an_import_reads_the_same_in_less_time(home: Path) -> None:
    read = []
    for name, bus in (("one", OneByOne), ("all", Watched)):
        made, file = chain(home, name, bus=bus), home.parent / "import.yaml"
        began_s = made.bus.now_s()
        with made.session(node=tuple(CHAIN)) as session:
            import_network(session, str(file))
        read.append((file.read_text("utf-8"), made.bus.now_s() - began_s))
    (one, one_s), (together, together_s) = read
    assert one == together
    assert together_s < 0.7 * one_s


@pytest.mark.counted
def test_a_fault_takes_every_node_back(home: Path, pytestconfig: pytest.Config) -> None:
    cells = [(fault, *step) for step in STEPS for fault in FAULTS]
    for fault, node_id, step in part(cells, 3 * pytestconfig.getoption("--kills"), pytestconfig, "side by side"):
        name = f"{fault[:4]}-{node_id}-{step}"
        made = chain(home, name, [f"{node_id}:{fault.format(step)}"])
        made.bus.layouts.clear()
        before, stored = made.held(), made.stored()
        with pytest.raises(DvtcliError) as raised:
            made.apply()
        dead = {node_id} if isinstance(raised.value, LeftChanged) else set[int]()
        assert bool(dead) == ("silent" in fault), (name, raised.value, raised.value.why)
        assert raised.value.state == ("left_changed" if dead else "rolled_back"), name
        reached = set(CHAIN) - dead
        assert {one: made.held()[one] for one in reached} == {one: before[one] for one in reached}, name
        assert made.stored() == stored
        assert len(made.journals()) == len(dead)
        shutil.rmtree(home)  # what is remembered of these nodes


def stopped(made: Chain, at: int, stop: Callable[[Session], None]) -> Interrupted:
    """How `apply` ends that is told to *stop* at its write number *at*."""
    before = made.held()
    with made.session() as session:
        made.bus.on_write = lambda count: stop(session) if count == at else None  # type: ignore[attr-defined]
        with pytest.raises(Interrupted) as raised:
            apply_file(session, str(FILE))
    assert made.held() == before
    assert made.journals() == []
    assert raised.value.state == "rolled_back"
    assert raised.value.text.endswith(f" of {len(STEPS)}")
    return raised.value


@heavy
@pytest.mark.parametrize("at", [1, 14, 30])
def test_a_request_to_stop_takes_every_node_back_and_says_how_far_it_was(home: Path, at: int) -> None:
    def stop(session: Session) -> None:
        session.cancellation.requested = True

    said = stopped(chain(home, "files"), at, stop)
    assert said.text.startswith("stopped at node ")


@heavy
@pytest.mark.parametrize("at", [1, 14, 30])
def test_whoever_tears_it_apart_finds_every_node_as_before(home: Path, at: int) -> None:
    def tear(session: Session) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        while not session.bus._turns._torn:  # type: ignore[attr-defined]
            time.sleep(0.001)

    said = stopped(chain(home, "files"), at, tear)
    assert said.text.startswith("stopped at once at node ")


@heavy
def test_a_stop_while_a_plan_is_read_is_obeyed_wherever_it_comes(home: Path) -> None:
    """What is read ahead of several nodes is read in threads: whatever ends one of them ends the plan."""
    made = chain(home, "files", bus=Torn)
    made.plan()
    count = made.bus.reads  # type: ignore[attr-defined]
    for quarter in range(5):
        made.bus.reads, made.bus.stops_at = 0, max(count * quarter // 4, 1)  # type: ignore[attr-defined]
        with pytest.raises(KeyboardInterrupt):
            made.plan()


def test_nodes_are_met_side_by_side_and_named_in_order(home: Path) -> None:
    made = chain(home, "files")
    took_s = []
    for absent in ([20], [22, 20, 21]):
        file = home.parent / f"{len(absent)}.yaml"
        nodes = "".join(f"  n{one}: {{node_id: {one}, tpdo: {{1: {{event_timer: 50}}}}}}\n" for one in [5, *absent, 9])
        file.write_text(f"nodes:\n{nodes}")
        began_s = made.bus.now_s()
        with pytest.raises(NoAnswer) as raised:
            made.plan(file)
        took_s.append(made.bus.now_s() - began_s)
    assert raised.value.text == "nodes 20, 21 and 22 do not answer"
    assert took_s[1] < 1.5 * took_s[0]

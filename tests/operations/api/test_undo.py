"""`Node.undo` puts back what this program changed, and then what earlier programs and commands did: refused alike."""

from __future__ import annotations

import subprocess
import sys

import can
import canopen
import pytest

import dvtcli
from dvtcli import errors
from dvtcli.results import Message
from dvtcli.testing import Serve, ServedBus
from tests.process import PATIENCE_S, environment

pytestmark = pytest.mark.drawn(2, "undo")


def in_another_program(served: ServedBus, *calls: str) -> None:
    """Run *calls* on `bus` in a process of its own."""
    lines = [
        "import dvtcli",
        f"bus = dvtcli.connect(**{served.settings}, timeout_s={PATIENCE_S})",
        *calls,
        "bus.close()",
    ]
    subprocess.run([sys.executable, "-c", "\n".join(lines)], env=environment(), check=True)


def timer(served: ServedBus, node_id: int = 5, number: int = 1) -> int:
    """The event timer of a TPDO as canopen reads it."""
    network = canopen.Network()
    with can.Bus(**served.settings) as bus:
        network.bus = bus
        network.notifier = can.Notifier(bus, network.listeners)
        try:
            node = network.add_node(node_id, canopen.ObjectDictionary())
            node.sdo.RESPONSE_TIMEOUT = PATIENCE_S
            return int.from_bytes(node.sdo.upload(0x1800 + number - 1, 5), "little")
        finally:
            network.notifier.stop()
            network.bus = None


@pytest.fixture
def served(dvtcli_serve: Serve) -> ServedBus:
    return dvtcli_serve("generic@5", "generic@7")


def test_each_call_puts_back_one_more_of_earlier_programs(served: ServedBus) -> None:
    before = timer(served)
    in_another_program(served, "bus.node(5).set('tpdo1', timer_ms=50)")
    in_another_program(served, "bus.node(5).set('tpdo1', timer_ms=60)")
    told: list[Message] = []
    with served.connect(on_message=told.append) as bus:
        assert bus.node(5).undo()
        assert timer(served) == 50
        bus.node(5).set("tpdo1", timer_ms=70)
        bus.node(5).undo()
        assert timer(served) == 50, "its own changes come first"
        undone = bus.node(5).undo()
        assert [step.object for step in undone.plan.steps] == ["1800:05"]
        assert timer(served) == before
        with pytest.raises(errors.UsageError, match="the history has no change of node 5"):
            bus.node(5).undo()
    assert len([one for one in told if "this undoes the change of" in one.text]) == 2


def test_a_call_that_changed_nothing_is_not_undone_in_an_earlier_programs_place(served: ServedBus) -> None:
    in_another_program(served, "bus.node(5).set('tpdo1', timer_ms=50)")
    with served.connect(timeout_s=PATIENCE_S) as bus:
        node = bus.node(5)
        for _ in range(3):
            node.set("tpdo1", timer_ms=60)
        assert node.undo(), "what this program changed comes first"
        assert timer(served) == 50
        for _ in range(2):
            with pytest.raises(errors.UsageError, match="changed nothing on node 5"):
                node.undo()
        assert timer(served) == 50
        assert node.undo(), "and then what the earlier program did"
        assert timer(served) != 50


def test_all_of_them_and_of_one_node_only(served: ServedBus) -> None:
    before = timer(served)
    in_another_program(
        served, *(f"bus.node({node_id}).set('tpdo1', timer_ms={ms})" for node_id, ms in ((5, 50), (7, 55), (5, 60)))
    )
    with served.connect(timeout_s=PATIENCE_S) as bus:
        assert bus.node(5).undo(everything=True)
        assert (timer(served), timer(served, 7)) == (before, 55)


def test_it_is_refused_where_the_node_holds_something_else(served: ServedBus) -> None:
    before = timer(served)
    in_another_program(served, "bus.node(5).set('tpdo1', timer_ms=50)")
    in_another_program(served, "bus.node(5).canopen().sdo.download(0x1800, 5, bytes([33, 0]))")
    with served.connect(timeout_s=PATIENCE_S) as bus:
        with pytest.raises(errors.SafetyRefusal, match="does not hold the values of that change") as refused:
            bus.node(5).undo()
        assert (refused.value.exit_code, refused.value.state) == (6, "unchanged")
        assert "undo(force=True)" in str(refused.value.hint)
        assert timer(served) == 33
        assert bus.node(5).undo(force=True)
        assert timer(served) == before


def test_a_dry_run_neither_writes_nor_forgets(served: ServedBus) -> None:
    before = timer(served)
    in_another_program(served, "bus.node(5).set('tpdo1', timer_ms=50)")
    with served.connect(timeout_s=PATIENCE_S) as bus:
        with bus.dry_run():
            assert len(bus.node(5).undo().plan) == 1
        assert timer(served) == 50
        assert bus.node(5).undo()
        assert timer(served) == before


def test_what_is_undone_is_not_among_the_steps_of_a_script() -> None:
    with dvtcli.simulate("generic") as bus:
        node = bus.node()
        node.set("tpdo1", timer_ms=50)
        node.set("tpdo2", timer_ms=60)
        node.undo()
        assert [line for line in bus.script(history=True).splitlines() if line.startswith("set")] == [
            "set tpdo1 --timer 50"
        ]

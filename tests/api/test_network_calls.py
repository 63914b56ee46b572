"""`bus.plan` and `bus.apply`: a network file by a program."""

from __future__ import annotations

from pathlib import Path

import pytest

import dvtcli
from dvtcli.errors import SafetyRefusal


def test_a_program_plans_and_applies_a_network_file(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    file.write_text("a: {node_id: 1, tpdo: {1: {event_timer: 70}}}\nb: {node_id: 5, tpdo: {1: {event_timer: 80}}}\n")
    with dvtcli.simulate("generic@1", "generic@5", ask=lambda question: "node 1, 5" in question) as bus:
        planned = bus.plan(file)
        assert (bool(planned), planned.plan.writes, planned.exit_code) == (False, 2, 0)
        assert bus.apply(file)
        assert bus.plan(file)
        assert [bus.node(one).pdos()["tpdo1"].config.communication.event_timer for one in (1, 5)] == [70, 80]
    with dvtcli.simulate("generic@1", "generic@5") as bus:
        with pytest.raises(SafetyRefusal):
            bus.apply(file)
        assert bus.apply(file, yes=True).exit_code == 0
        assert bus.node(5).pdos()["tpdo1"].config.communication.event_timer == 80

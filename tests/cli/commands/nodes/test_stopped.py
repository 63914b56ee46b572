"""A node that does not answer SDO can still be commanded: NMT needs no dictionary."""

from __future__ import annotations

import pytest

from dvtcli.domain.nmt import NmtState
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device


@pytest.mark.drawn(2)
@pytest.mark.parametrize(
    ("command", "state"),
    [
        ("preop", NmtState.PRE_OPERATIONAL),
        ("start", NmtState.OPERATIONAL),
        ("reset-node", NmtState.PRE_OPERATIONAL),
        ("reset-comm", NmtState.PRE_OPERATIONAL),
    ],
)
@pytest.mark.parametrize("family", ["generic", "gen4"])
def test_a_stopped_node_is_brought_back_by_the_first_command(command: str, state: NmtState, family: str) -> None:
    """A new process has heard nothing of the node; `nmt preop` is the hint it gives."""
    node = device(family)
    node.download(0x1017, 0, bytes(2))  # no heartbeat tells its state, however slow this computer is
    with Wire(node) as wire, Bench((), dict(wire.options)) as bench:
        assert bench.run("read 1000").code == 0
        node.state = NmtState.STOPPED
        bench.session.close()
        assert bench.run("read 1000 --timeout 0.1").code == 5
        if command.startswith("reset"):
            assert bench.run(f"nmt {command} --timeout 0.1").code == 6, "its operation may be enabled"
        ran = bench.run(f"nmt {command} --yes --timeout 0.5")
        assert ran.code == 0, ran.stderr
        assert node.state is state
        assert bench.run("read 1000").code == 0


@pytest.mark.parametrize("line", ["set tpdo1 --timer 70", "write 1017 700", "read 1000", "pdo tpdo1"])
def test_a_node_that_was_heard_to_be_stopped_is_refused_with_that_reason(line: str) -> None:
    with Bench(("generic@5",), {"yes": True, "timeout": 0.1}) as bench:
        assert bench.run("nmt stop").code == 0
        ran = bench.run(f"{line} --json")
        error = ran.documents[-1]
        assert (ran.code, error["exit_code"], error["error"], error["state"]) == (6, 6, "safety", "unchanged")
        assert error["text"] == "node 5 is STOPPED: it answers no SDO"
        assert error["hint"] == "`nmt preop 5`" or "nmt preop 5" in error["hint"]
        assert bench.run("nmt preop 5").code == 0
        assert bench.run(line).code == 0

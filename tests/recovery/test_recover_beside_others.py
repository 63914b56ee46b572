"""`recover` finishes what was interrupted, not what another dvtcli is doing; and it is done only once that stays."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.device.node import Node
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan, plan_pdo
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device
from tests.cli.commands.network.test_verify_restarts import Restarting, restarting
from tests.harness.sample import heavy

TPDO1 = Pdo.parse("tpdo1")


def under_way(node: Node, nmt_state: NmtState | None = None) -> Path:
    """Put the journal of a change of TPDO1's event timer to 50 ms on disk, as its first step; where it is."""
    assert node.guard is not None
    now = node.pdo(TPDO1)
    after = now.with_parameters(event_timer=50)
    return node.guard.journals.write(Plan(1, (plan_pdo(TPDO1, now, after),)), node.identity(), nmt_state)


@pytest.mark.parametrize("line", ["recover", "recover --accept", "recover --discard", "recover FILE"])
def test_a_change_that_is_under_way_is_left_alone(tmp_path: Path, line: str) -> None:
    options = {"yes": True, "journal": str(tmp_path)}
    with (
        Wire(device("generic")) as wire,
        Bench((), {**wire.options, **options}) as at_work,
        Bench((), {**wire.options, **options, "yes": False}) as bench,
    ):
        node = at_work.session.node()
        node.begin_change()
        journal = under_way(node)
        bench.session.node()
        wire.frames()
        ran = bench.run(f"{line} --json".replace("FILE", str(journal)))
        assert (ran.code, ran.document["state"]) == (6, "unchanged")
        assert "another dvtcli" in ran.document["text"]
        assert journal.exists()
        sent = [one.data for one in wire.frames() if one.arbitration_id == 0x601]
        assert not sent, "what is being changed is no state to judge"


def test_once_that_change_is_done_there_is_nothing_to_recover_and_nobody_is_kept_out(tmp_path: Path) -> None:
    options = {"yes": True, "journal": str(tmp_path)}
    with Wire(device("generic")) as wire, Bench((), {**wire.options, **options}) as bench:
        with Bench((), {**wire.options, **options}) as at_work:
            node = at_work.session.node()
            node.begin_change()
            under_way(node)
            assert bench.run("recover").code == 6
            assert node.guard is not None
            node.guard.own_journal.end()
        ran = bench.run("recover --json")
        assert (ran.code, ran.document["recovered"]) == (0, False)
        with Bench((), {**wire.options, **options}) as another:
            assert another.run("set tpdo1 --timer 9").code == 0


def test_a_dry_run_looks_at_it_without_the_lock(tmp_path: Path) -> None:
    options = {"yes": True, "journal": str(tmp_path)}
    with Wire(device("generic")) as wire, Bench((), {**wire.options, **options}) as bench:
        under_way(bench.session.node())
        assert bench.run("recover --dry-run").code == 0
        with Bench((), {**wire.options, **options}) as another:
            assert another.run("recover").code == 0


@heavy
def test_a_node_that_restarts_when_it_is_started_is_put_back_again(tmp_path: Path) -> None:
    served = restarting()
    with Wire(served) as wire, Bench((), {**wire.options, "yes": True, "journal": str(tmp_path)}) as bench:
        node = bench.session.node()
        assert bench.run("nmt reset-node").code == 0  # its boot-up tells that it is PRE-OPERATIONAL
        assert bench.run("set tpdo1 --timer 5").code == 0
        journal = under_way(node, NmtState.OPERATIONAL)
        served.when_started = True
        ran = bench.run("recover --json")
        assert not served.when_started
        assert (ran.code, ran.document["verified"]) == (0, True)
        (finding,) = (one for one in ran.document["findings"] if one["rule"] == "restarted-meanwhile")
        assert finding["text"] == "node 1 restarted: other unstored values are lost"
        assert node.pdo(TPDO1).communication.event_timer == 5, "the restart had taken it"
        assert not journal.exists()
        assert served.state is NmtState.OPERATIONAL


class AlwaysRestarting(Restarting):
    """A device that restarts whenever it is started."""

    def nmt(self, command: int) -> None:
        self.when_started = True
        super().nmt(command)


def test_a_node_that_restarts_whenever_it_is_started_keeps_its_journal(tmp_path: Path) -> None:
    served = AlwaysRestarting(read_eds(family_eds("gen4")).dictionary, load_family("gen4"), 1)
    with Wire(served) as wire, Bench((), {**wire.options, "yes": True, "journal": str(tmp_path)}) as bench:
        assert bench.run("nmt reset-node").code == 0
        journal = under_way(bench.session.node(), NmtState.OPERATIONAL)
        ran = bench.run("recover --json")
        assert (ran.code, ran.document["state"]) == (7, "left_changed")
        assert "restarted during each of 5 roll-backs" in ran.document["text"]
        assert ran.document["file"] == str(journal) or str(journal) in ran.stdout
        assert journal.exists()

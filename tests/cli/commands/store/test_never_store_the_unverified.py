"""What was lost, refused or found different is not stored, and is said."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.bench import Bench, beside
from tests.operations.network.bench import device
from tests.process import dvtcli


def run(*lines: str, words: tuple[str, ...] = ("--sim", "generic")) -> tuple[list[str], str]:
    """Run *lines* with --keep-going; the lines of stdout, and stderr."""
    done = dvtcli(*words, "run", "-", "--keep-going", stdin="\n".join(lines) + "\n")
    assert "Traceback" not in done.stderr
    return done.stdout.splitlines(), done.stderr


def test_a_restart_nobody_asked_for_is_said_and_forbids_to_store() -> None:
    out, err = run(
        "set tpdo1 --timer 100", "set tpdo2 --inhibit 20", "store", words=("--sim", "generic", "--fault", "reset@3=0.1")
    )
    assert "restarted" in err
    assert "TPDO1" in err
    assert "restarted since it was read; run it again" in err
    assert not any("stored, acknowledged" in line for line in out)


def test_an_unrelated_verify_does_not_allow_it_again() -> None:
    out, err = run(
        "map tpdo2 6041",
        "map tpdo1 6041 606C",
        "verify tpdo2",
        "store",
        words=("--sim", "gen4", "--fault", "refuse@8=0x08000021"),
    )
    assert "0x08000021" in err
    assert err.count("is not stored") == 1
    assert "set the lost values again and check with `dvtcli --sim gen4 pdo`, then store; or reset instead; " in err, (
        "no other program knows what was set"
    )
    assert any("read back" in line for line in out)


def test_a_group_keeps_the_rest_pending() -> None:
    out, err = run("write 607A 500", "set tpdo1 --timer 7", "store communication", "nmt reset-node")
    assert any(line.endswith("changed since the last store: TPDO1") for line in out) or "that group alone" in err
    assert "607A:00" in err, "the reset says what it lost"


def test_undo_to_what_was_found_leaves_nothing_to_store() -> None:
    out, _ = run("map tpdo1 606C", "undo", "store")
    assert any(line.endswith("nothing by dvtcli") for line in out)


@pytest.mark.parametrize("words", [("-i", "virtual"), ("-c", "can0")])
def test_a_simulated_node_is_on_no_real_bus(words: tuple[str, ...]) -> None:
    done = dvtcli("--sim", "gen4", *words, "pdo")
    assert done.returncode == 2
    assert "a simulated node has its own bus" in done.stderr


def test_a_folder_that_cannot_hold_a_journal_is_no_bug(tmp_path: Path) -> None:
    from tests.recovery.bench import Bench

    blocked = tmp_path / "file"
    blocked.write_text("")
    bench = Bench(blocked)
    try:
        code, _, err = bench.run("set", "tpdo2", "--timer", "7")
        assert code == 6, err
        assert "it is a file, not a folder" in err
        assert bench.wire.downloads == 0
        assert bench.run("read", "1018:1")[0] == 0
    finally:
        bench.wire.close()


@pytest.mark.long
def test_a_recover_that_fails_keeps_the_journal_and_its_progress(tmp_path: Path) -> None:
    from tests.recovery.bench import MAP, Bench

    bench = Bench(tmp_path)
    try:
        before = bench.pdos()
        bench.killed(6, *MAP)
        bench.wire.slowness_s = 4.0
        code, _, err = bench.run("recover", "--yes", "--timeout", "2")
        assert code == 7, err
        assert len(bench.journals()) == 1
        bench.wire.slowness_s = 0.0
        code, _, err = bench.run("recover", "--yes")
        assert code == 0, err
        assert bench.pdos() == before
        assert not bench.journals()
    finally:
        bench.wire.close()


class Restarting(StrictDevice):
    """A device that restarts at a store, ahead of it, without a boot-up message; what comes up is stored."""

    restarts = True

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        if index == 0x1010 and self.restarts:
            self.restart()
            self.boot_up()
            self.take_outbox()
        super().download(index, sub_index, data)


@pytest.mark.parametrize("line", ["set tpdo1 --timer 250", "write 1017 300 --as u16"])
def test_a_restart_that_nobody_heard_is_seen_behind_the_store(line: str) -> None:
    served = device(5, "generic")
    served.__class__ = Restarting
    with Bench((), {"yes": True, "eds": "generic", "node": 5}, beside([served])) as bench:
        assert bench.run(line).code == 0
        ran = bench.run("store --json")
        assert (ran.code, ran.document["state"]) == (1, "unknown"), ran.stdout
        assert "node 5 does not have the values to be stored" in ran.document["text"]
        assert isinstance(served, Restarting)
        served.restarts = False
        assert bench.run("store").code == 6, "nor is it stored later"
        assert bench.run(line).code == 0
        assert bench.run("store").code == 0

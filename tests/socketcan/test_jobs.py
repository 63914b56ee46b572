"""The whole way of a job over the kernel's CAN: scan, map, store, monitor, and a recording beside candump."""

from __future__ import annotations

from pathlib import Path

import can
import pytest

from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import device
from tests.process import PATIENCE_S, dvtcli, start
from tests.simulator.serve.served import own_environment
from tests.socketcan.conftest import ANSWER_S, PAIRS, on, tool
from tests.socketcan.recorded import candump, frames_in, log, seen_by

WORDS = ("-i", "socketcan", "-c", "vcan0", "-n", "1", "--timeout", str(ANSWER_S))
OPTIONS = {"interface": "socketcan", "channel": "vcan0", "node": 1, "timeout": ANSWER_S}
#: frames of 8 bytes that count up
CANGEN = ("-I", "i", "-L", "8", "-D", "i")
on_each_pair = pytest.mark.parametrize(("ours", "theirs"), PAIRS)


@on_each_pair
def test_scan_finds_them_all(ours: str, theirs: str) -> None:
    nodes = device("gen4", 1), device("generic", 64), device("generic", 127)
    with on(theirs, *nodes), Bench((), OPTIONS | {"channel": ours}) as bench:
        ran = bench.run("scan --json --wait 150")
    assert [row["node"] for row in ran.document["nodes"]] == [1, 64, 127], ran.stderr


@on_each_pair
def test_map_and_a_store_that_is_proved(ours: str, theirs: str) -> None:
    with on(theirs, device("gen4")), Bench((), OPTIONS | {"channel": ours}) as bench:
        assert bench.run("map tpdo1 6041 606C/32 --sync 1").code == 0
        ran = bench.run("store --prove --yes")
        assert ran.code == 0, ran.stderr
        assert "proved" in ran.stdout


def test_a_store_names_what_other_processes_changed() -> None:
    with on("vcan0", device("gen4")):
        for words in (("map", "tpdo1", "6041", "--sync", "1"), ("set", "tpdo2", "--timer", "250")):
            ran = dvtcli(*WORDS, *words)
            assert ran.returncode == 0, ran.stderr
        ran = dvtcli(*WORDS, "store", "--prove", "--yes")
        assert ran.returncode == 0, ran.stderr
        assert "nothing by dvtcli" not in ran.stdout
        assert "tpdo1" in ran.stdout.lower()
        assert "proved" in ran.stdout


@on_each_pair
def test_monitor_names_what_passes(tmp_path: Path, ours: str, theirs: str) -> None:
    with on(theirs, device("gen4")), Bench((), OPTIONS | {"channel": ours}) as bench:
        assert bench.run("nmt start --yes").code == 0
        words = ["-i", "socketcan", "-c", ours, "--timeout", str(ANSWER_S), "monitor", "--json"]
        monitor = start(words, env=own_environment(tmp_path))
        seen_by(monitor, lambda rows: "tpdo2" in {row.get("pdo") for row in rows})


def test_a_recording_under_a_flood_has_what_candump_has(tmp_path: Path) -> None:
    """Each frame is in the file or counted as dropped; candump beside it is what was there."""
    path, beside = tmp_path / "run.log", tmp_path / "candump.log"
    with candump("vcan0", beside):
        logged = log(
            "vcan0", path, beside, meanwhile=lambda: tool("cangen", "vcan0", "-g", "0.5", *CANGEN, "-n", "3000")
        )
    assert frames_in(beside) == 3000
    assert frames_in(path) + logged["dropped"] == 3000
    assert logged["dropped"] == 0, "there is room for more than that"
    assert path.read_text().count("\n") == logged["frames"]


def test_a_recording_of_a_controller_has_what_candump_has(tmp_path: Path) -> None:
    """What the controller itself could not take is in neither."""
    path, beside = tmp_path / "run.log", tmp_path / "candump.log"
    with candump("can0", beside):
        logged = log("can0", path, beside, meanwhile=lambda: tool("cangen", "can1", "-g", "5", *CANGEN, "-n", "200"))
    assert frames_in(path) + logged["dropped"] == frames_in(beside) > 0


def test_what_the_kernel_drops_is_said(tmp_path: Path) -> None:
    with Bench((), OPTIONS) as bench:
        assert bench.run("log first.log --duration 0.1").code == 0
        bus = bench.session.wire
        lost_before = bus.lost_frame_count()
        while bus.lost_frame_count() == lost_before:  # nobody reads meanwhile
            tool("cangen", "vcan0", "-g", "0", "-p", "10", *CANGEN, "-n", "45000")
        ran = bench.run("log second.log --duration 0.1 --json")
        assert "this computer dropped" in ran.stderr


def test_a_recording_is_played_by_canplayer(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    log("vcan0", path, meanwhile=lambda: tool("cangen", "vcan0", *CANGEN, "-n", "50"))
    wanted = path.read_text().count("\n")
    assert wanted >= 52, "and the marks"
    with can.Bus("vxcan1", interface="socketcan", ignore_config=True) as other:
        tool("canplayer", "-t", "-I", str(path), "vxcan0=can0")
        played = sum(other.recv(PATIENCE_S) is not None for _ in range(wanted))
        assert (played, other.recv(0)) == (wanted, None)

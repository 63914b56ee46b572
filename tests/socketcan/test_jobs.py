"""The whole way of a job over the kernel's CAN: scan, map, store, monitor, and a recording beside candump."""

from __future__ import annotations

import subprocess
from pathlib import Path

import can

from tests.commands.bench import Bench
from tests.commands.bus import device
from tests.process import dvtcli
from tests.socketcan.conftest import on, tool

WORDS = ("-i", "socketcan", "-c", "vcan0", "-n", "1")
OPTIONS = {"interface": "socketcan", "channel": "vcan0", "node": 1}


def test_scan_finds_them_all() -> None:
    nodes = device("gen4", 1), device("generic", 64), device("generic", 127)
    with on("vxcan1", *nodes), Bench((), {"interface": "socketcan", "channel": "vxcan0"}) as bench:
        ran = bench.run("scan --json")
    assert [row["node"] for row in ran.document["nodes"]] == [1, 64, 127], ran.stderr


def test_map_and_a_store_that_is_proved() -> None:
    with on("vcan0", device("gen4")), Bench((), OPTIONS) as bench:
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


def test_monitor_names_what_passes() -> None:
    with on("vcan0", device("gen4")), Bench((), OPTIONS) as bench:
        assert bench.run("nmt start --yes").code == 0
        ran = bench.run("monitor --duration 1 --json")
        assert ran.code == 0, ran.stderr
    assert {"tpdo2"} <= {row["pdo"] for row in ran.documents if row.get("pdo")}


def flood(count: int, gap_ms: float) -> None:
    """As many frames as cangen makes, at most one each *gap_ms*."""
    tool("cangen", "vcan0", "-g", str(gap_ms), "-I", "i", "-L", "8", "-D", "i", "-n", str(count))


def test_a_recording_under_a_flood_has_what_candump_has(tmp_path: Path) -> None:
    """Each frame is in the file or counted as dropped; candump beside it is what was there."""
    path, beside = tmp_path / "run.log", tmp_path / "candump.log"
    with beside.open("w") as file, subprocess.Popen(["candump", "-L", "-r", "8000000", "vcan0"], stdout=file) as dump:
        with Bench((), OPTIONS) as bench:
            flooding = subprocess.Popen(
                ["sh", "-c", "sleep 1; exec cangen vcan0 -g 0.5 -I i -L 8 -D i -n 3000"], stdin=subprocess.DEVNULL
            )
            ran = bench.run(f"log {path} --duration 5 --json")
            flooding.wait()
        dump.terminate()
    there = beside.read_text().count("\n")
    assert there == 3000
    assert ran.code == 0, ran.stderr
    assert ran.document["frames"] + ran.document["dropped"] == there, ran.stderr
    assert ran.document["dropped"] == 0, "there is room for more than that"
    assert path.read_text().count("\n") == ran.document["frames"]


def test_what_the_kernel_drops_is_said(tmp_path: Path) -> None:
    with Bench((), OPTIONS) as bench:
        assert bench.run("log first.log --duration 0.1").code == 0
        bus = bench.session.wire
        lost_before = bus.lost_frame_count()
        with can.Bus("vcan0", interface="socketcan", ignore_config=True) as other:
            message = can.Message(arbitration_id=0x123, data=bytes(8), is_extended_id=False)
            while bus.lost_frame_count() == lost_before:  # nobody reads meanwhile
                for _ in range(1000):
                    other.send(message)
        ran = bench.run("log second.log --duration 0.1 --json")
        assert "this computer dropped" in ran.stderr


def test_a_recording_is_played_by_canplayer(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    with on("vcan0", device("gen4")), Bench((), OPTIONS) as bench:
        assert bench.run("nmt start --yes").code == 0
        assert bench.run(f"log {path} --duration 0.5").code == 0
    wanted = path.read_text().count("\n")
    with can.Bus("vxcan1", interface="socketcan", ignore_config=True) as other:
        tool("canplayer", "-t", "-I", str(path), "vxcan0=can0")
        played = 0
        while other.recv(0.2) is not None:
            played += 1
    assert played == wanted > 0

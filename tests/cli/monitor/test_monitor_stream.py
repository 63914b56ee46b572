"""`monitor` in a pipe: one document a frame."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

from tests.harness.sample import heavy
from tests.process import PATIENCE_S, documents, dvtcli, start
from tests.simulator.serve.served import bus_words, own_environment, served, wait_for


def test_a_frame_is_a_document_with_its_signals() -> None:
    done = dvtcli("--sim", "gen4", stdin="nmt start\nmonitor --for 1\n")
    assert done.returncode == 0, done.stderr
    found = documents("\n".join(line for line in done.stdout.splitlines() if line.startswith("{")))
    assert {one["schema"] for one in found} == {"dvtcli.frame/1"}
    tpdo2 = [one for one in found if one["pdo"] == "tpdo2"]
    assert len(tpdo2) >= 5
    assert tpdo2[0]["node"] == 1
    assert tpdo2[0]["cob_id"] == 0x281
    assert tpdo2[0]["data"].startswith("24 FA FF FF")
    assert tpdo2[0]["signals"]["Velocity actual value"] == -1500
    assert [one["time"] for one in found] == sorted(one["time"] for one in found)
    assert all(one["time"].endswith("Z") for one in found)


def test_changes_and_filter_leave_out_what_says_nothing_new() -> None:
    done = dvtcli("--sim", "gen4", stdin="nmt start\nmonitor --duration 1 --changes --filter velocity\n")
    found = documents("\n".join(line for line in done.stdout.splitlines() if line.startswith("{")))
    assert [one["pdo"] for one in found] == ["tpdo2"]


@heavy
def test_a_bus_from_outside_until_ctrl_c(tmp_path: Path) -> None:
    with served(tmp_path, "gen4@5") as server:
        words = [sys.executable, "-m", "dvtcli", *bus_words(server.port), "monitor", "--nodes", "5"]
        process = subprocess.Popen(
            words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8",
            env=own_environment(tmp_path),
        )  # fmt: skip
        assert process.stdout is not None
        (first,) = documents(process.stdout.readline())
        assert first["schema"] == "dvtcli.frame/1"
        process.send_signal(signal.SIGINT)
        _, complaints = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert "Traceback" not in complaints


def test_a_node_that_is_silent_shows_its_frames_as_bytes(tmp_path: Path) -> None:
    with served(tmp_path, "gen4@5") as server:
        words = [*bus_words(server.port), "monitor", "--nodes", "9", "--timeout", "0.1"]
        watching = start(words, env=own_environment(tmp_path))
        wait_for(lambda: '"heartbeat"' in watching.so_far()[0], "a heartbeat")
        watching.send_signal(signal.SIGINT)
        out, errors = watching.communicate(PATIENCE_S)
    assert watching.returncode == 130, errors
    assert "node 9: its mapping cannot be read" in errors
    assert all(one["signals"] == {} for one in documents(out))
    assert any(one["kind"] == "heartbeat" and one["node"] == 5 for one in documents(out))


def test_values_without_an_eds_are_said_to_have_no_sign(tmp_path: Path) -> None:
    with served(tmp_path, "lely@5") as server:
        done = server.dvtcli("monitor", "--nodes", "5", "--duration", "0.5")
    assert done.returncode == 0, done.stderr
    assert "node 5 has no EDS: its values have no names and are unsigned" in done.stderr


def test_wrong_words_are_usage_errors() -> None:
    for words in (["--nodes", "0"], ["--nodes", "1,x"], ["--duration", "0"], ["--dbc", "no-such.dbc"]):
        done = dvtcli("--sim", "gen4", "monitor", *words)
        assert done.returncode == 2, (words, done.stdout, done.stderr)

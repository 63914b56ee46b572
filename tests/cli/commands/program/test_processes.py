"""dvtcli as a process: exit codes, streams, settings, signals; what a shell and a CI job see."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.process import PATIENCE_S, ROOT, documents, dvtcli, environment, run

pytestmark = pytest.mark.drawn(8, "processes")

PDO_FIELDS = {
    "pdo", "enabled", "cob_id", "extended", "rtr_allowed", "transmission_type", "inhibit_ms", "event_timer_ms",
    "sync_start", "bits", "mapping",
}  # fmt: skip


def run_in(folder: Path, *words: str, stdin: str = "", **more: str) -> subprocess.CompletedProcess[str]:
    """Run dvtcli in *folder* with *more* environment."""
    return run(words, stdin=stdin, cwd=folder, env=environment() | more)


def test_results_go_to_stdout_and_messages_to_stderr() -> None:
    good = dvtcli("--sim", "gen4", "map", "tpdo1", "606C")
    assert good.returncode == 0
    assert "606C:00" in good.stdout
    bad = dvtcli("--sim", "gen4", "map", "tpdo1", "1018:1")
    assert bad.returncode == 1
    assert bad.stdout == ""
    assert "is not mappable" in bad.stderr


def test_the_documents_have_the_stable_fields() -> None:
    ran = dvtcli("--sim", "gen4", "--json", stdin="pdo tpdo1\nread 1800:1\nmap tpdo1 606C --sync 1\nread 5FFF\n")
    assert ran.returncode == 1
    listing, value, change, error = documents(ran.stdout)
    assert listing["schema"] == "dvtcli.pdo/1"
    assert listing["node"] == 1
    assert listing["pdos"][0].keys() >= PDO_FIELDS
    assert listing["pdos"][0]["mapping"][0].keys() >= {"object", "bits", "name", "start_bit"}
    assert value.items() >= {
        "schema": "dvtcli.value/1", "node": 1, "object": "1800:01", "value": 0x181, "raw": "81 01 00 00", "type": "u32"
    }.items()  # fmt: skip
    assert change.items() >= {
        "schema": "dvtcli.change/1", "node": 1, "pdo": "tpdo1", "verified": True, "stored": False, "dry_run": False
    }.items()  # fmt: skip
    assert change["writes"] == len(change["steps"])
    first = {"object": "1800:01", "before": "81 01 00 00", "after": "81 01 00 80"}
    assert change["steps"][0].items() >= first.items()
    assert "reason" in change["steps"][0]
    assert error.items() >= {
        "schema": "dvtcli.error/1", "exit_code": 1, "error": "sdo_abort", "node": 1, "object": "5FFF:00",
        "abort": "0x06020000", "state": "unchanged",
    }.items()  # fmt: skip
    assert "text" in error
    assert "hint" in error


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize(
    ("line", "state"),
    [
        ("objects", "unchanged: nothing was written"),
        ("pdo tpdo1 --json", "unchanged: nothing was written"),
        ("--help", "unchanged: nothing was written"),
        ("map tpdo1 606C --json", "written as planned and verified before that"),
    ],
)
def test_results_that_a_full_disk_loses_are_said(line: str, state: str) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "dvtcli", "--sim", "gen4", *line.split()],
            stdout=full, stderr=subprocess.PIPE, encoding="utf-8", env=environment(), timeout=PATIENCE_S, check=False,
        )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.startswith("error: the results cannot be written: No space left on device")
    assert f"  state   {state}\n" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("option", [["--json"], ["--format", "json"]])
@pytest.mark.parametrize("behind", [True, False])
def test_options_work_before_and_after_the_command(option: list[str], behind: bool) -> None:
    words = ["read", "1800:1"]
    ran = dvtcli(*(words if behind else option), *(option if behind else words), "--sim", "gen4")
    assert ran.returncode == 0
    assert json.loads(ran.stdout)["value"] == 0x181


def test_usage_errors_are_documents_too() -> None:
    ran = dvtcli("--sim", "gen4", "map", "tpdo1", "--json")
    assert ran.returncode == 2
    assert json.loads(ran.stdout)["schema"] == "dvtcli.error/1"


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["--sim", "gen4", "bogus"], 2),
        (["--sim", "bogus", "pdo"], 2),
        (["-n", "0", "pdo"], 2),
        (["-n", "0x80", "pdo"], 2),
        (["-n", "9", "--sim", "gen4@1", "--timeout", "0.1", "pdo"], 5),
        (["-n", "1", "-i", "nosuch", "pdo"], 5),
        (["-n", "1", "-i", "socketcan", "-c", "nosuch0", "pdo"], 5),
        (["--sim", "gen4", "--eds", "nofile.eds", "pdo"], 2),
        (["--sim", "gen4", "--eds", "tests/cli/commands/program/help_examples.toml", "pdo"], 4),
        (["--sim", "gen4", "--profile", "nosuch", "pdo"], 2),
        (["--sim", "gen4", "--timeout", "never", "pdo"], 2),
        (["--sim", "gen4", "restore"], 6),
        (["--sim", "gen4", "write", "60FF", "-Z"], 2),
        (["-Z"], 2),
        (["--help"], 0),
        (["map", "--help"], 0),
        (["--version"], 0),
    ],
)
def test_exit_codes(words: list[str], code: int) -> None:
    ran = dvtcli(*words)
    assert ran.returncode == code, ran.stderr
    assert "Traceback" not in ran.stderr
    if code:
        assert ran.stderr.startswith("error: ")
        assert ran.stdout == ""


def test_negative_numbers_are_values() -> None:
    ran = dvtcli("--sim", "generic", "--json", stdin="write 60FF -1500\nread 60FF\nwrite 60FF -0x10\nread 60FF\n")
    assert ran.returncode == 0
    assert [document["value"] for document in documents(ran.stdout) if "value" in document] == [-1500, -16]
    assert dvtcli("write", "60FF", "-1500", "--sim", "generic").returncode == 0


def test_a_wrong_negative_word_is_quoted_as_it_was_typed() -> None:
    ran = dvtcli("--sim", "generic", "nmt", "-5")
    assert (ran.returncode, "'-5' is not one of" in ran.stderr) == (2, True)


def test_several_pairs_after_one_bus_kwargs_get_a_hint() -> None:
    ran = dvtcli("-n", "1", "-i", "socketcand", "--bus-kwargs", "host=127.0.0.1", "port=1", "pdo")
    assert ran.returncode == 2
    assert "repeat" in ran.stderr
    assert "--bus-kwargs" in ran.stderr


def test_a_closed_port_is_no_answer_at_once() -> None:
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        port = closed.getsockname()[1]
    words = ["-i", "socketcand", "-c", "can0", "--bus-kwargs", "host=127.0.0.1", "--bus-kwargs", f"port={port}"]
    ran = dvtcli("-n", "1", *words, "pdo")
    assert ran.returncode == 5
    assert "hint" in ran.stderr


def test_no_interface_says_what_to_give() -> None:
    ran = dvtcli("-n", "1", "pdo")
    assert ran.returncode == 5
    assert "--sim" in ran.stderr


def test_settings_come_from_the_environment_and_from_a_file(tmp_path: Path) -> None:
    assert json.loads(run_in(tmp_path, "read", "1018:1", DVTCLI_SIM="gen4", DVTCLI_FORMAT="json").stdout)["value"] == 30
    two = run_in(tmp_path, "node", "2", "--json", DVTCLI_SIM="gen4 tmcm")
    assert json.loads(two.stdout)["nodes"][0]["vendor_id"] == 0x286
    below = tmp_path / "a" / "b"
    below.mkdir(parents=True)
    settings = tmp_path / "dvtcli.toml"
    for text in ('sim = "gen4"\nformat = "json"\n', 'sim = ["gen4"]\nformat = "json"\ntimeout = 1\n'):
        settings.write_text(text)
        ran = run_in(below, "read", "1018:1")
        assert ran.returncode == 0, ran.stderr
        assert json.loads(ran.stdout)["value"] == 30
    assert json.loads(run_in(below, "read", "1018:1", DVTCLI_SIM="tmcm").stdout)["value"] == 0x286
    for text in ("dry-run = true\nsim = ['gen4']\nnode = 1\nyes = true\nverbose = 1\n", "sim = ['gen4']\nnode = '0x1'"):
        settings.write_text(text)
        assert run_in(below, "pdo").returncode == 0
    for text in ("sim = [", "bogus = 1", "sim = ['gen4']\nnode = 128", "sim = ['gen4']\ntimeout = 'x'", "sim = 5"):
        settings.write_text(text)
        ran = run_in(below, "pdo")
        assert ran.returncode in (2, 4), text
        assert "Traceback" not in ran.stderr
        assert ran.stderr.startswith("error: ")


@pytest.mark.parametrize("words", [["objects"], ["objects", "--json"], ["--help"], ["map", "--help"]])
def test_a_reader_that_leaves_is_no_error(words: list[str]) -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "dvtcli", "--sim", "gen4", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment(),
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.wait(PATIENCE_S) == 0
        assert process.stderr.read() == b""


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("line", ["sync --count 100000 --period 5", "node\nsync --count 100000 --period 5\npdo"])
def test_signals_end_it_with_their_code(number: signal.Signals, code: int, line: str) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "dvtcli", "--sim", "gen4", "run", "-"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment(),
        encoding="utf-8",
    )
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(f"read 1000\n{line}\n")
    process.stdin.close()
    process.stdin = None
    assert process.stdout.readline()  # the first line's answer: the next one runs
    process.send_signal(number)
    stdout, stderr = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == code, stderr
    assert "Traceback" not in stderr
    assert re.search("interrupted|terminated", stderr)
    assert "TPDO1" not in stdout


_INTERRUPTED_IMPORT = """
import sys
from dvtcli.__main__ import entry
from dvtcli.cli.main import main
main(["--version"])
try:
    exec("raise KeyboardInterrupt")  # as in the making of a dataclass
except KeyboardInterrupt:
    pass
sys.argv = ["dvtcli", "--version"]
entry()
"""


def test_a_caught_interrupt_does_not_kill_the_process_at_its_end(tmp_path: Path) -> None:
    (tmp_path / "interrupted.py").write_text(_INTERRUPTED_IMPORT, "utf-8")
    run = subprocess.run(
        [sys.executable, "-m", "interrupted"],
        capture_output=True,
        env=environment() | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"},
        cwd=tmp_path,
        check=False,
    )
    assert run.returncode == 0, run.stderr

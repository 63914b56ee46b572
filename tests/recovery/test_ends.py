"""Other ends of a change: a terminal that is closed, a state folder that is full, a driver that ends the program."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.posix import NO_TERMINAL
from tests.process import PATIENCE_S, ROOT, documents, environment
from tests.recovery.bench import MAP, STEPS, Bench
from tests.recovery.test_signals import PRE_OPERATIONAL, STATE, held, start

pytestmark = pytest.mark.drawn(5, "ends")

pty = pytest.importorskip("pty", reason=NO_TERMINAL)
resource = pytest.importorskip("resource", reason="limits of a process are set this way on POSIX only")

NEW_COB_ID = bytes.fromhex("01020000")
_DRIVER = """
import os
from can.interfaces.socketcand import SocketCanDaemonBus

class FailingBus(SocketCanDaemonBus):
    downloads = 0

    def send(self, msg, timeout=None):
        super().send(msg, timeout)
        if msg.arbitration_id == 0x605 and msg.data[0] >> 5 == 1:
            self.downloads += 1
            if self.downloads == 3:
                raise {"SystemExit": SystemExit(0), "LookupError": LookupError("a driver's own")}[os.environ["RAISES"]]
"""


@pytest.mark.parametrize("words", [MAP, ("run", "x.dvt")])
def test_a_terminal_that_is_closed_rolls_back_and_restores_the_nmt_state(
    bench: Bench, words: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "x.dvt").write_text(" ".join(MAP))
    before = start(bench)
    with bench.wire.at_work:
        pid, terminal = pty.fork()
        if pid == 0:
            os.chdir(tmp_path)
            program = [sys.executable, "-m", "dvtcli", *bench.words, "--yes", *words]
            os.execve(sys.executable, program, {**environment(), "PYTHONPATH": str(ROOT)})  # noqa: S606
        bench.wire.at_download = lambda number: os.close(terminal) if number == 4 else None
    _, status = os.waitpid(pid, 0)
    assert os.waitstatus_to_exitcode(status) == 129
    assert held(bench) == before
    assert not bench.journals()


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_a_disk_that_is_full_at_the_end_of_a_change_undoes_nothing(bench: Bench, options: list[str]) -> None:
    def fill(number: int) -> None:
        if number == STEPS:
            resource.prlimit(child.pid, resource.RLIMIT_FSIZE, (0, 0))

    with bench.wire.at_work:
        child = subprocess.Popen(
            [sys.executable, "-m", "dvtcli", *bench.words, *MAP, *options], stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", env=environment(),
        )  # fmt: skip  # with pipes, which are never full
        bench.wire.at_download = fill
    stdout, stderr = child.communicate(timeout=PATIENCE_S)
    assert child.returncode == 0, stderr
    assert "the state folder takes nothing more (File too large)" in stderr
    assert "unchanged" not in stdout + stderr
    assert held(bench)[0x1800, 1] == NEW_COB_ID
    assert not bench.journals()
    assert bench.run("set", "tpdo2", "--timer", "9")[0] == 0


def test_a_disk_that_is_full_before_the_first_write_leaves_no_journal(bench: Bench) -> None:
    assert bench.run("set", "tpdo2", "--timer", "9")[0] == 0
    before, downloads = held(bench), bench.wire.downloads
    bench.folder.joinpath("journals").rmdir()
    bench.folder.joinpath("journals").write_text("a file where the folder should be")
    code, _, stderr = bench.run(*MAP)
    assert code == 6
    assert "nothing was written" in stderr
    assert (held(bench), bench.wire.downloads) == (before, downloads)


def test_a_journal_that_cannot_be_removed_is_said_with_what_the_device_holds(bench: Bench) -> None:
    def block(number: int) -> None:
        if number == STEPS:
            (path,) = bench.journals()
            path.unlink()
            path.mkdir()

    bench.wire.at_download = block
    child = bench.start(*MAP, "--json")
    stdout, stderr = child.communicate(timeout=PATIENCE_S)
    assert child.returncode == 1, stderr
    (error,) = documents(stdout)
    assert (error["error"], error["state"], error["exit_code"]) == ("journal_kept", "left_changed", 1)
    assert held(bench)[0x1800, 1] == NEW_COB_ID


@pytest.mark.parametrize("raises", ["SystemExit", "LookupError"])
@pytest.mark.parametrize("options", [[], ["--json"]])
def test_what_a_driver_raises_is_a_bug_and_never_success(
    bench: Bench, tmp_path: Path, raises: str, options: list[str]
) -> None:
    (tmp_path / "failing_bus.py").write_text(_DRIVER)
    info = tmp_path / "failing_bus-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: failing-bus\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[can.interface]\nfailing = failing_bus:FailingBus\n")
    before = start(bench)
    words = ["failing" if word == "socketcand" else word for word in bench.words]
    ran = subprocess.run(
        [sys.executable, "-m", "dvtcli", *words, "--yes", *MAP, *options],
        env=environment() | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}", "RAISES": raises, "HOME": str(tmp_path)},
        capture_output=True, encoding="utf-8", timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert ran.returncode == 70, ran.stderr
    (kept,) = tmp_path.rglob("crash/dvtcli-crash-*.txt")
    assert raises in kept.read_text()
    assert str(kept) in (json.loads(ran.stdout)["hint"] if options else ran.stderr)
    after = held(bench)
    assert after.pop((STATE, 0))[0] == PRE_OPERATIONAL, "after a bug of ours it is not known what it did"
    assert "node 5 was OPERATIONAL and is PRE-OPERATIONAL now" in ran.stderr
    before.pop((STATE, 0))
    assert after == before

"""Tcl's process is killed, or ours is: the device is whole, nobody is left behind, and the exit code is never 0."""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.cli.dvt.children import children, descriptors, is_running, started, wait_until_gone
from tests.posix import SIGKILL, STOPPING, needs_own_python, needs_sessions, needs_signals
from tests.process import PATIENCE_S, environment
from tests.recovery.bench import MAP, STEPS, Bench

pytestmark = [
    pytest.mark.skipif(
        importlib.util.find_spec("_tkinter") is None, reason="Python has no _tkinter here (Debian: python3-tk)"
    ),
    pytest.mark.skipif(
        not Path(f"/proc/self/task/{os.getpid()}/children").exists(), reason="this system does not show children"
    ),
    pytest.mark.drawn(8, "tcl killed"),
]


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path / "state")
    yield made
    made.wire.close()


def script(folder: Path) -> str:
    """A script that makes the change and would go on; the path of its file."""
    path = folder / "x.tcl"
    path.write_text(f"catch {{dvtcli {' '.join(MAP)}}}\nputs never\nwhile 1 {{}}\n")
    return str(path)


def at(step: int, act: Callable[[], object]) -> Callable[[int], None]:
    """What happens when the node is about to see the SDO download number *step*."""
    return lambda number: None if number != step else act() and None


@pytest.fixture
def mapped(tmp_path: Path) -> object:
    """What a device holds that was configured without Tcl."""
    other = Bench(tmp_path / "other")
    code, _, stderr = other.run(*MAP)
    pdos = other.pdos()
    other.wire.close()
    assert code == 0, stderr
    return pdos


@pytest.mark.drawn(4)
@pytest.mark.parametrize("step", range(1, STEPS + 1))
def test_a_change_is_whole_after_tcls_process_was_killed_within_it(
    step: int, bench: Bench, mapped: object, tmp_path: Path
) -> None:
    def kill() -> None:
        (child,) = children(process.pid)
        os.kill(child, SIGKILL)
        wait_until_gone(child)

    with bench.wire.at_work:
        process = bench.start("run", script(tmp_path))
        bench.wire.at_download = at(step, kill)
    stdout, stderr = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1, stderr
    assert "Tcl's process ended before the script did" in stderr
    assert "it was killed by SIGKILL" in stderr
    assert "x.tcl:1" in stderr
    assert "never" not in stdout
    assert bench.wire.downloads == STEPS
    assert bench.pdos() == mapped
    assert not bench.journals()


@pytest.mark.parametrize("number", STOPPING)
def test_a_signal_rolls_back_also_where_tcls_process_is_dead(
    number: signal.Signals, bench: Bench, tmp_path: Path
) -> None:
    before = bench.pdos()

    def kill_and_signal() -> None:
        os.kill(children(process.pid)[0], SIGKILL)
        process.send_signal(number)

    with bench.wire.at_work:
        process = bench.start("run", script(tmp_path))
        bench.wire.at_download = at(3, kill_and_signal)
    _, stderr = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 128 + number, stderr
    assert bench.pdos() == before
    assert not bench.journals()


def test_tcls_process_dies_with_ours_and_recover_finishes(bench: Bench, tmp_path: Path) -> None:
    before = bench.pdos()
    left: list[int] = []

    def kill() -> None:
        left.extend(children(process.pid))
        process.kill()
        process.wait()

    with bench.wire.at_work:
        process = bench.start("run", script(tmp_path))
        bench.wire.at_download = at(4, kill)
    process.communicate(timeout=PATIENCE_S)
    assert process.returncode == -SIGKILL
    wait_until_gone(left[0])
    assert len(bench.journals()) == 1
    assert bench.run("recover", "--yes")[0] == 0
    assert bench.pdos() == before


@needs_signals
@pytest.mark.drawn(4)
@pytest.mark.parametrize("busy", ["while 1 {}", "expr {3**[set n 200000000]}", "after 100000000", "vwait x"])
@pytest.mark.parametrize("number", [SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_nobody_is_left_computing(busy: str, number: signal.Signals, tmp_path: Path) -> None:
    path = tmp_path / "x.tcl"
    path.write_text(f"puts [sdo_rnx 1 0x1018 1]\n{busy}\n")
    process = started("--sim", "gen4", "run", str(path))
    assert process.stdout is not None
    assert process.stdout.readline() == "0x0000001E\n"
    (child,) = children(process.pid)
    assert is_running(child)
    process.send_signal(number)
    process.communicate(timeout=PATIENCE_S)
    assert process.returncode == (-9 if number is SIGKILL else 128 + number)
    wait_until_gone(child)


@needs_signals
@pytest.mark.parametrize("number", [SIGKILL, signal.SIGSEGV, signal.SIGTERM])
def test_tcls_process_killed_while_it_computes_is_an_error(number: signal.Signals, tmp_path: Path) -> None:
    path = tmp_path / "x.tcl"
    path.write_text("puts [sdo_rnx 1 0x1018 1]\nwhile 1 {}\n")
    process = started("--sim", "gen4", "run", str(path))
    assert process.stdout is not None
    assert process.stdout.readline() == "0x0000001E\n"
    os.kill(children(process.pid)[0], number)
    _, stderr = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1, stderr
    assert f"it was killed by {number.name}" in stderr


@needs_sessions
def test_it_has_its_pipes_only_and_no_terminal(bench: Bench, tmp_path: Path) -> None:
    """In the middle of a change: the bus is open, the lock is held and the journal written."""
    seen: list[dict[int, str]] = []
    sessions: list[int] = []

    def look() -> None:
        (child,) = children(process.pid)
        seen.extend([descriptors(child), descriptors(process.pid)])
        sessions.extend([os.getsid(child), child])
        os.kill(child, SIGKILL)

    with bench.wire.at_work:
        process = bench.start("run", script(tmp_path))
        bench.wire.at_download = at(5, look)
    process.communicate(timeout=PATIENCE_S)
    own, parents = seen
    assert any(what.startswith("socket:") for what in parents.values()), "the bus"
    pipes = [what for what in own.values() if what.startswith("pipe:")]
    assert len(pipes) == 3
    assert set(own.values()) == {os.devnull, *pipes}
    assert sessions[0] == sessions[1]


@needs_own_python
def test_it_imports_nothing_of_dvtcli_but_itself() -> None:
    done = subprocess.run(
        [sys.executable, "-c", "import sys, dvtcli.cli.dvt.tcl_child\nprint(*sys.modules)"],
        capture_output=True, encoding="utf-8", env=environment(), check=True, timeout=PATIENCE_S,
    )  # fmt: skip
    modules = set(done.stdout.split())
    ours = {
        "dvtcli",
        "dvtcli.cli.dvt",
        "dvtcli.cli.dvt.tcl_child",
        "dvtcli.cli",
        "dvtcli.cli.dvt.tcl_wire",
        "dvtcli.files",
        "dvtcli.files.bounded_child",
        "dvtcli.version",
    }
    assert {name for name in modules if name.split(".")[0] == "dvtcli"} == ours
    assert not modules & {"can", "canopen", "click", "rich", "asyncio", "socket", "subprocess", "pathlib"}

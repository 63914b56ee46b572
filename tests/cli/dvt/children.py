"""The process in which Tcl runs, as the system shows it: found below dvtcli's process, and looked at."""

from __future__ import annotations

import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

from tests.process import PATIENCE_S, environment


def started(*words: str) -> subprocess.Popen[str]:
    """A dvtcli with *words*, its streams piped, in a session of its own as a terminal gives it."""
    return subprocess.Popen(
        [sys.executable, "-m", "dvtcli", *words],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", env=environment(),
    )  # fmt: skip


def children(pid: int) -> list[int]:
    """The process-IDs of the children of *pid*."""
    found: list[int] = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        with suppress(FileNotFoundError, ProcessLookupError):  # a thread that has ended meanwhile
            found += map(int, (task / "children").read_text().split())
    return found


def is_running(pid: int) -> bool:
    """Whether the process *pid* is there and does more than wait for somebody to look at its exit code."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"


def wait_until_gone(pid: int) -> None:
    """Wait for the end of the process *pid*."""
    until = time.monotonic() + PATIENCE_S
    while is_running(pid):
        assert time.monotonic() < until, f"process {pid} lives on"
        time.sleep(0.02)


def descriptors(pid: int) -> dict[int, str]:
    """What each descriptor of the process *pid* is."""
    return {int(link.name): str(link.readlink()) for link in Path(f"/proc/{pid}/fd").iterdir()}

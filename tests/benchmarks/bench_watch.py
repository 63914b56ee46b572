"""What a frame of a live bus costs `log` and `monitor`, beside python-can's logger on the same bus at the same time.

    python -m tests.benchmarks watch

A sender puts TPDOs of a simulated node on the bus of a `dvtcli sim` on 127.0.0.1. `log` and python-can's logger record
them into .log files, `monitor` and python-can's logger print them into pipes: processor time of whole processes from
the first frame to the last one, by frame (Linux). Each process must have all frames.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import can

from tests.benchmarks.bench_monitor import send, words
from tests.benchmarks.bench_serve import Sim, sim
from tests.benchmarks.figures import ENVIRONMENT, ROOT, Figure

RATE, SECONDS = 5_500, 4.0
#: name, words of dvtcli and of python-can's logger with a place for a file, and the goal
ROWS: list[tuple[str, list[str], list[str], float]] = [
    ("log into a .log file", ["log", "{}"], ["-f", "{}"], 1.5),
    ("monitor in a pipe", ["monitor"], [], 1.5),
]
#: CAN-ID of the sent frames in a candump file, in what python-can's logger prints, and in what `monitor` prints
_MARKS = (b" 281#", b"ID:      281 ", b'"cob_id":641,')
#: a process is quiet that takes less than this (s) in half a second, and has to be so in time (s)
_QUIET_S, _PATIENCE_S = 0.02, 60.0
#: less than the start of any of them takes (s)
_START_S = 0.1
#: python-can's logger does not flush: so many frames may be in its buffer of 8 KiB
_BUFFERED = 8192 // len(" 281#0000000000000000\n")


class Watcher:
    """A process whose output, in *file*, has a line for each frame."""

    def __init__(self, process: subprocess.Popen[bytes], file: Path) -> None:
        self._process, self._file = process, file

    def count(self) -> int:
        """How many of the sent frames its output has; all of them once it has ended."""
        data = self._file.read_bytes() if self._file.exists() else b""
        return sum(data.count(mark) for mark in _MARKS)

    def cpu_s(self) -> float:
        """Processor time of all its threads so far (s)."""
        tasks = Path(f"/proc/{self._process.pid}/task").glob("*/schedstat")
        return sum(int(task.read_text().split()[0]) for task in tasks) / 1e9

    def quiet_s(self, count: int = 0) -> float:
        """Its processor time (s) once it has *count* frames, but for those in its buffer, and nothing to do."""
        end_s, now_s, is_quiet = time.monotonic() + _PATIENCE_S, 0.0, False
        while not is_quiet or now_s < _START_S or self.count() < count - _BUFFERED:
            assert self._process.poll() is None, self._process.args
            assert time.monotonic() < end_s, self._process.args
            time.sleep(0.5)
            before_s, now_s = now_s, self.cpu_s()
            is_quiet = now_s - before_s < _QUIET_S
        return now_s


@contextmanager
def watcher(command: list[str], file: Path) -> Iterator[Watcher]:
    """Run *command*, which writes to *file* where it has `{}`; else its output goes there, through a pipe."""
    piped = "{}" not in command
    environment = {**ENVIRONMENT, "HOME": str(file.parent)}
    with ExitStack() as stack:
        process = subprocess.Popen(
            [str(file) if word == "{}" else word for word in command], cwd=ROOT, env=environment,
            stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            stdout=subprocess.PIPE if piped else subprocess.DEVNULL,
        )  # fmt: skip
        if process.stdout is not None:
            out = stack.enter_context(file.open("wb"))
            stack.callback(subprocess.Popen(["cat"], stdin=process.stdout, stdout=out).wait)
            process.stdout.close()
        stack.callback(process.wait)
        stack.callback(process.send_signal, signal.SIGINT)
        yield Watcher(process, file)


def logger(server: Sim, *more: str) -> list[str]:
    """The command line of python-can's logger."""
    bus = ["-i", "socketcand", "-c", "can0", "--bus-kwargs", "host=127.0.0.1", f"port={server.port}"]
    return [sys.executable, "-m", "can.logger", *more, *bus]


def frame_us(commands: Sequence[list[str]], bus: can.BusABC) -> list[float]:
    """Processor time (µs) of each of *commands* for a frame that is sent on *bus*, which all of them watch."""
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{number}.log" for number in range(len(commands))]
        with ExitStack() as stack:
            watchers = [stack.enter_context(watcher(*pair)) for pair in zip(commands, files, strict=True)]
            before = [each.quiet_s() for each in watchers]
            sent = send(bus, SECONDS, RATE)
            took = [each.quiet_s(sent) - cpu_s for each, cpu_s in zip(watchers, before, strict=True)]
        assert [each.count() for each in watchers] == [sent] * len(watchers)
    return [1e6 * cpu_s / sent for cpu_s in took]


def figures(rounds: int) -> Iterator[Figure]:
    """Each of ROWS."""
    for name, own_words, other_words, most in ROWS:
        pairs = []
        for _ in range(rounds):
            with sim("gen4@1") as server, server.bus() as bus:
                pairs.append(frame_us((words(server, *own_words), logger(server, *other_words)), bus))
        own, other = zip(*pairs, strict=True)
        yield Figure(f"a frame: {name}", "µs", own, "python-can's logger", other, most=most)

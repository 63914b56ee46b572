"""`--json` with a pipe on stdin: each line of a program is answered as it comes, by a process that lives on."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from dvtcli.cli.live_lines import chunks
from tests.cli.commands.bench import Bench
from tests.posix import needs_signals
from tests.process import PATIENCE_S, environment

pytestmark = pytest.mark.drawn(3, "live lines")


class Child:
    """A dvtcli that a program drives."""

    def __init__(self, *words: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "dvtcli", *words, "--json"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, env=environment(), text=True, encoding="utf-8",
        )  # fmt: skip

    def send(self, text: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(text)
        self.process.stdin.flush()

    def answer(self) -> dict[str, Any]:
        """The next document, which has to come before anything else is sent."""
        assert self.process.stdout is not None
        return json.loads(self.process.stdout.readline())

    def ask(self, line: str) -> dict[str, Any]:
        self.send(f"{line}\n")
        return self.answer()

    def end(self) -> int:
        assert self.process.stdin is not None
        self.process.stdin.close()
        return self.process.wait(PATIENCE_S)


@contextmanager
def child(*words: str) -> Iterator[Child]:
    made = Child(*words)
    patience = threading.Timer(PATIENCE_S, made.process.kill)
    patience.start()
    try:
        yield made
    finally:
        patience.cancel()
        made.process.kill()
        made.process.wait()
        for stream in (made.process.stdin, made.process.stdout, made.process.stderr):
            assert stream is not None
            stream.close()


def test_each_line_is_answered_before_the_next_one_is_sent() -> None:
    with child("--sim", "gen4@1", "--sim", "generic@5") as driven:
        assert driven.ask("read 1017")["value"] == 500
        changed = driven.ask("set tpdo1 --timer 70")
        assert (changed["schema"], changed["verified"]) == ("dvtcli.change/1", True)
        refused = driven.ask("map tpdo1 1018:1")
        assert (refused["schema"], refused["exit_code"], refused["at"]) == ("dvtcli.error/1", 1, "<stdin>:3")
        assert driven.ask("read 1800:5")["value"] == 70, "a line that failed ends nothing"
        assert driven.ask("mapp tpdo1")["exit_code"] == 2
        driven.send("# a comment and an empty line say nothing\n\n")
        assert driven.ask("verify")["schema"] == "dvtcli.verify/1", "lines before are remembered"
        driven.send("read \\\n")
        assert driven.ask("1018:1")["object"] == "1018:01", "a line that goes on is waited for"
        assert driven.ask("node 5")["schema"] == "dvtcli.nodes/1"
        assert driven.ask("pdo tpdo1")["node"] == 5
        driven.send("exit\n")
        assert driven.process.wait(PATIENCE_S) == 1, "the code of the first line that failed"


def test_lines_that_come_together_are_a_script() -> None:
    with child("--sim", "gen4") as driven:
        driven.send("set tpdo1 --timer 70\nmap tpdo1 1018:1\nset tpdo1 --timer 90\n")
        assert driven.answer()["schema"] == "dvtcli.change/1"
        assert driven.answer()["at"] == "<stdin>:2"
        assert driven.ask("read 1800:5")["value"] == 70, "what came after the failing line was not done"
        driven.send("set tpdo1 --timer 30\nsett tpdo1 --timer 40\n")
        assert driven.answer()["exit_code"] == 2, "all of them are parsed before the first one runs"
        assert driven.ask("read 1800:5")["value"] == 70
        driven.send("read 1800:2")
        assert driven.end() == 1
        assert driven.answer()["object"] == "1800:02", "the last line needs no end"


def test_nothing_is_asked_and_nothing_to_do_is_well() -> None:
    with child("--sim", "gen4") as driven:
        assert driven.ask("restore")["exit_code"] == 6
        assert driven.end() == 6
    with child("--sim", "gen4") as driven:
        assert driven.end() == 0


@pytest.mark.parametrize("is_in_script", [False, True], ids=["line", "script"])
@pytest.mark.parametrize(("requirement", "error", "code"), [
    ("require identity vendor=0x99", "safety", 6),
    ("require power-off", "safety", 6),
    ("require 1:power-off", "safety", 6),
    ("require 9:identity vendor=0x99", "no_answer", 5),
    ("require 9:power-off", "no_answer", 5),
])  # fmt: skip
def test_nothing_is_done_behind_a_requirement_that_failed(
    requirement: str, error: str, code: int, is_in_script: bool, tmp_path: Path
) -> None:
    """However slowly the lines come: what follows the refusal finds nobody who reads it."""
    (tmp_path / "guard.dvt").write_text(f"{requirement}\n")
    line = f"run {tmp_path / 'guard.dvt'}" if is_in_script else requirement
    with child("--sim", "gen4@1", "--sim", "generic@5", "--signal", "6041=const(0x27)") as driven:
        assert driven.ask("map tpdo1 1018:1")["exit_code"] == 1
        refused = driven.ask(line)
        assert (refused["error"], refused["exit_code"]) == (error, code)
        assert driven.process.wait(PATIENCE_S) == code, "it waits for no other line, and the refusal's code counts"
        assert driven.process.stdout is not None
        assert driven.process.stdout.read() == ""


@needs_signals
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_it_while_it_waits(number: int, code: int) -> None:
    with child("--sim", "gen4") as driven:
        assert driven.ask("read 1017")["value"] == 500
        driven.process.send_signal(number)
        assert driven.process.wait(PATIENCE_S) == code


def test_a_signal_that_came_before_it_waits_is_not_lost() -> None:
    with Bench() as bench:
        session, (there, here) = bench.session, os.pipe()
        session.cancellation.hold()  # as a line does that is complete
        session.cancellation.asked(130, insists=True)
        with os.fdopen(there, "rb") as stdin, os.fdopen(here, "wb"), pytest.raises(KeyboardInterrupt):
            next(chunks(session, stdin.fileno()))

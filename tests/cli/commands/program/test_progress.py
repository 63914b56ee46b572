"""How far long work has come: one line that is written over at a terminal, a line each 10 % elsewhere, on stderr."""

from __future__ import annotations

import io
import os
import re
import time
from typing import TextIO

import pytest

from dvtcli.cli.view.output import Output, ProgressLine
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.request import PdoRequest
from dvtcli.operations.changes.change import configure
from dvtcli.operations.devices.learn_device import learn
from dvtcli.operations.results import LearntDevice
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.operations.user.session_user import NullReporter
from tests.harness.sample import heavy
from tests.posix import NO_TERMINAL

pty = pytest.importorskip("pty", reason=NO_TERMINAL)


def said_at_once(stderr: TextIO) -> Output:
    """An output that says how far work is from its beginning on."""
    output = Output(io.StringIO(), stderr)
    output.progress_line = ProgressLine(stderr, terminal_s=0.0, pipe_s=0.0)
    return output


class Follower(NullReporter):
    """Keeps what it is told of progress."""

    def __init__(self) -> None:
        self.said: list[tuple[str, int, int]] = []

    def progress(self, text: str, done: int, total: int) -> None:
        self.said.append((text, done, total))


def test_each_object_that_is_read_and_each_step_is_told_as_it_happens() -> None:
    follower = Follower()
    with Session(Options(sim=("generic",)), follower) as session:
        configure(session, session.node(), {Pdo.parse("tpdo1"): PdoRequest(cob_id=0x1A7)})
    texts = [text for text, *_ in follower.said]
    assert "node 1: reading 0x1600:00 of RPDO1, PDO 5 of 8" in texts
    steps = [(done, total) for text, done, total in follower.said if ": step " in text]
    assert steps == [(1, 2), (2, 2)]
    assert texts[-1].startswith("node 1: step 2 of 2  0x1800:01 <- 0x")
    assert texts[-1].endswith("; reading back")


@heavy
def test_each_write_of_learn_is_told_as_it_happens() -> None:
    follower = Follower()
    with Session(Options(sim=("tmcm",), yes=True), follower) as session:
        learnt = learn(session)
    assert isinstance(learnt, LearntDevice)
    texts = [text for text, *_ in follower.said]
    assert "listening for 1.5 s to which CAN-IDs are in use" in texts
    looks = [one for one in follower.said if one[0].startswith("node 1: which objects of its EDS are there, ")]
    assert [(done, total) for _, done, total in looks] == [(n, len(looks)) for n in range(len(looks))]
    assert len(looks) > 20
    writes = [text for text in texts if text.startswith("node 1: learning, write ")]
    assert len(writes) == learnt.writes
    assert [int(text.split()[4]) for text in writes] == [*range(1, learnt.writes + 1)]


def test_a_pipe_gets_a_line_each_tenth_of_what_takes_long() -> None:
    stderr = io.StringIO()
    output = said_at_once(stderr)
    for done in range(41):
        output.progress(f"part {done}", done, 40)
    output.progress("nobody knows", 0, 0)
    assert stderr.getvalue().splitlines() == [f"part {done}" for done in range(4, 41, 4)]


def test_without_a_terminal_no_line_is_said_twice() -> None:
    """As by a scan that begins anew with each node it found, or where the same objects are read before and after."""
    stderr = io.StringIO()
    output = said_at_once(stderr)
    for found in (0, 1, 0):
        for done in range(11):
            output.progress(f"{found} nodes found", done, 10)
    assert stderr.getvalue().splitlines() == ["0 nodes found", "1 nodes found"]


def test_without_a_terminal_lines_are_as_far_apart_as_the_first_one_is_late() -> None:
    """Many short works, as one for each node, are no page of lines."""
    stderr = io.StringIO()
    output = Output(io.StringIO(), stderr)
    output.progress_line = ProgressLine(stderr, pipe_s=0.1)
    began_s = time.monotonic()
    while stderr.getvalue().count("\n") < 3:
        for done in range(11):
            output.progress(f"at {time.monotonic()}", done, 10)
    assert stderr.getvalue().count("\n") * 0.1 <= time.monotonic() - began_s  # however slow the machine is


def test_what_is_done_at_once_is_no_progress() -> None:
    stderr = io.StringIO()
    output = Output(io.StringIO(), stderr)
    for done in range(11):
        output.progress("part", done, 10)
    assert stderr.getvalue() == ""


def test_a_terminal_shows_one_line_which_is_gone_before_anything_else(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    master, slave = pty.openpty()
    with os.fdopen(slave, "w") as stderr:
        output = said_at_once(stderr)
        output.color = "never"
        output.progress("node 5: reading 0x1800:01 of TPDO1", 0, 0)
        output.progress("node 5: step 1 of 1", 1, 1)
        output.note("done")
        shown = ""
        while "done\r\n" not in shown:
            shown += os.read(master, 4096).decode()
    os.close(master)
    lines = re.split(r"\r\x1b\[K", shown)
    assert lines[:3] == ["", "node 5: reading 0x1800:01 of TPDO1", "node 5: step 1 of 1"]
    assert lines[3].startswith("note: done")
    assert len(lines) == 4


@pytest.mark.parametrize("given", [{"quiet": True}, {"format_name": "json"}, {"verbose": 1}])
def test_where_only_errors_documents_or_traffic_are_wanted_it_is_not_shown(given: dict[str, object]) -> None:
    stderr = io.StringIO()
    output = said_at_once(stderr)
    options = {"format_name": "text", "color": "never", "verbose": 0, "quiet": False, "plain": False, **given}
    output.configure(**options)  # type: ignore[arg-type]
    output.progress("part", 5, 10)
    assert stderr.getvalue() == ""

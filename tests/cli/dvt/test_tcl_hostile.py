"""A process that speaks rubbish in the place of Tcl's: it is ended, with an error, and nothing was done for it."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest

from dvtcli.cli.dvt.tcl_run import LIMITS, TclProcess, TclScript
from dvtcli.cli.dvt.tcl_wire import (  # fmt: skip
    Call,
    CallResult,
    End,
    Frame,
    Go,
    Gone,
    Ready,
    Setup,
    WireError,
    decode,
    encode,
    receive,
)
from dvtcli.errors import DvtcliError
from tests.cli.commands.bench import Bench
from tests.process import PATIENCE_S, ROOT

#: ValueFormatter *lines* as if it was Tcl; what it is told, it reads only where `hear` is called.
FAKE = """
import os, sys, time
sys.path.insert(0, {root!r})
from dvtcli.cli.dvt.tcl_wire import *
calls = os.fdopen(1, "wb", closefd=False)
hear = sys.stdin.buffer.readline
def say(what):
    calls.write(what if isinstance(what, bytes) else encode(what))
    calls.flush()
def ready():
    hear(); say(Ready("", 0)); hear()
{body}
"""

BROKEN = [
    ("pass", "ended before the script did"),
    ("sys.exit(3)", "it ended with 3"),
    ("hear(); say(b'rubbish\\n')", "not JSON"),
    ("hear(); say(b'\\xff\\xfe\\n')", "not JSON"),
    ("hear(); say(b'[' * 100000 + b'\\n')", "violated its protocol"),
    ("hear(); say(b'[' + b'1' * 100000 + b']\\n')", "not JSON"),
    ("hear(); say(b'{}\\n')", "no frame"),
    ("hear(); say(b'[]\\n')", "no frame"),
    ("hear(); say(b'[[]]\\n')", "no frame"),
    ("hear(); say(b'[\"Gibberish\"]\\n')", "'Gibberish' is not allowed now"),
    ("hear(); say(Call('store', ('1',), 1, 'x'))", "'Call' is not allowed now"),
    ("hear(); say(End('done', '', 0, ''))", "'End' is not allowed now"),
    ("hear(); say(encode(Ready('', 0))[:5])", "ended before the script did"),
    ("hear(); say(b'[\"Ready\", \"\"]\\n')", "Ready with 1 fields"),
    ("hear(); say(b'[\"Ready\", \"\", true]\\n')", "Ready.unclosed is no int"),
    ("hear(); say(b'[\"Ready\", \"\", -1]\\n')", "Ready.unclosed is no int"),
    ("hear(); say(b'[\"Ready\", \"\", 1e999]\\n')", "Ready.unclosed is no int"),
    ("hear(); say(b'[\"Ready\", null, 0]\\n')", "Ready.missing is no str"),
    ("ready(); say(Ready('', 0))", "'Ready' is not allowed now"),
    ("ready(); say(Go())", "'Go' is not allowed now"),
    ("ready(); say(CallResult(False, 'OK'))", "'CallResult' is not allowed now"),
    ("ready(); say(Setup('/etc/passwd', (), 1.0, 1, 1))", "'Setup' is not allowed now"),
    ("ready(); say(b'[\"Call\", \"store\", \"1\", 1, \"x\"]\\n')", "Call.texts is no tuple[str, ...]"),
    ("ready(); say(b'[\"Call\", \"store\", [1], 1, \"x\"]\\n')", "Call.texts is no tuple[str, ...]"),
    ("ready(); say(b'[\"Call\", [\"store\"], [], 1, \"x\"]\\n')", "Call.name is no str"),
    ("ready(); say(Call('nosuch', (), 1, 'x'))", "asked for 'nosuch', which is not served"),
    ("ready(); say(Call('__class__', (), 1, 'x'))", "which is not served"),
    ("ready(); say(End('well', '', 0, ''))", "for an unknown reason"),
    ("ready(); say(End('failed', '', 0, ''))", "x.tcl: "),
    ("ready(); say(b'x' * (17 << 20))", "a line of more than 16777216 bytes"),
    ("ready(); os.close(1); time.sleep(600)", "it was killed by SIGKILL"),
    ("ready(); time.sleep(600)", "stopped after 0.3 s of computing"),
    ("ready()\nwhile True: say(Call('file', ('exists', 'x'), 1, 'x'))", "stopped after 0.3 s of computing"),
    ("ready()\nwhile True: say(b'x')", "stopped after 0.3 s"),
]  # fmt: skip


def fake(body: str) -> list[str]:
    """The words that start such a process."""
    return [sys.executable, "-c", FAKE.format(root=str(ROOT), body=body)]


def failed(bench: Bench, folder: Path, body: str, seconds: float = PATIENCE_S) -> DvtcliError:
    """How the script ends whose Tcl is *body*, which may compute for *seconds*."""
    (folder / "x.tcl").write_text("puts x\n")
    with TclProcess(fake(body)) as process:
        made = TclScript(bench.session, str(folder / "x.tcl"), process, LIMITS._replace(seconds=seconds))
        try:
            made.check()
            made.run()
        except DvtcliError as error:
            return error
    raise AssertionError("nothing was said of it")


@pytest.mark.drawn(6)
@pytest.mark.parametrize(("body", "says"), BROKEN)
def test_rubbish_ends_the_script(body: str, says: str, tmp_path: Path) -> None:
    with Bench() as bench:
        error = failed(bench, tmp_path, body, 0.3 if "stopped after" in says else PATIENCE_S)
        assert says in f"{error.text} {error.why}"
        assert error.exit_code != 0
        assert f"{tmp_path}/x.tcl" in error.text
        assert not bench.session.is_open


def test_who_never_begins_is_not_waited_for(tmp_path: Path) -> None:
    (tmp_path / "x.tcl").write_text("puts x\n")
    with Bench() as bench, TclProcess(fake("time.sleep(600)")) as process:
        made = TclScript(bench.session, str(tmp_path / "x.tcl"), process, LIMITS, start_s=0.2)
        with pytest.raises(DvtcliError, match="did not start within"):
            made.check()


def test_a_program_that_is_not_there_is_an_error_of_its_own(tmp_path: Path) -> None:
    with pytest.raises(DvtcliError, match="cannot be started") as raised:
        TclProcess([str(tmp_path / "python")])
    assert raised.value.why == f"{tmp_path}/python: No such file or directory"


def test_what_it_may_ask_for_is_what_a_script_may(tmp_path: Path) -> None:
    """Whoever speaks in the place of Tcl gets no file, no program and no way past the rules."""
    asked = [
        ("source", "/etc/passwd"), ("open", "../x"), ("exec", "ls"), ("dvtcli", "run", "x.dvt"),
        ("dvtcli", "verify", "/etc/passwd"), ("dvtcli", "read", "1018:1", "--eds", "/etc/passwd"),
        ("puts", "file3", "x"),
    ]  # fmt: skip
    body = (
        f"ready()\nfor name, *texts in {asked[:5] + asked[6:]!r}:\n"
        "    say(Call(name, tuple(texts), 1, 'x'))\n    answer = decode(hear(), CallResult)\n"
        "    assert answer.failed, (name, answer)\n    sys.stderr.flush()\n"
        f"say(Call('dvtcli', {asked[5][1:]!r}, 2, 'y' * 5000)); hear()"
    )
    (tmp_path / "x.tcl").write_text("puts x\n")
    with Bench() as bench:
        stderr = bench.session.output.stderr = io.StringIO()
        with TclProcess(fake(body)) as process:
            made = TclScript(bench.session, str(tmp_path / "x.tcl"), process, LIMITS)
            made.check()
            bench.session.started = True
            assert made.run() == 2
        assert "--eds sets the bus" in stderr.getvalue()
        assert not bench.session.is_open


def test_terminal_sequences_in_what_it_says_are_not_printed(tmp_path: Path) -> None:
    with Bench() as bench:
        error = failed(bench, tmp_path, "ready(); say(End('failed', 'a\\x1b[31mb', 7, '/x/\\x1b[31m.tcl'))")
        stderr = bench.session.output.stderr = io.StringIO()
        bench.session.output.error(error)
        assert "\x1b" not in stderr.getvalue()


@pytest.mark.parametrize(
    "frame",
    [
        Setup("/x/ü.tcl", ("puts", "exit"), 0.5, 3, 1 << 30), Ready("no Tcl", 0), Ready("", 17), Go(),
        Call("puts", ("", "a\nb\0", "\ud800", "\U0001f600"), 3, "/x/y.tcl"), CallResult(True, "no\nway"),
        CallResult(False, ""),
        End("failed", "because", 3, "/x"),
    ],
)  # fmt: skip
def test_every_frame_comes_as_it_was_sent(frame: Frame) -> None:
    line = encode(frame)
    assert line.count(b"\n") == 1
    assert decode(line, type(frame)) == frame
    assert receive(io.BytesIO(line * 2), type(frame)) == frame
    with pytest.raises(Gone):
        receive(io.BytesIO(line[:-1]), type(frame))
    with pytest.raises(WireError, match="is not allowed now"):
        decode(line, Go if not isinstance(frame, Go) else End)

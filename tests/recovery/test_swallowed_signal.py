"""A Ctrl-C that falls into a place from which Python lets no exception out is obeyed all the same."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.process import PATIENCE_S, environment

#: a driver's object that is thrown away after it could not be opened, as python-can's buses are
PROGRAM = """
import os, signal, sys, time
from dvtcli.cli.signals import catch_signals
from dvtcli.device.cancellation import Cancellation

class Driver:
    def __del__(self):
        time.sleep(0.0033)  # what was swallowed before is sent again 20 ms later
        os.kill(os.getpid(), signal.{name})

cancellation = Cancellation()
catch_signals(cancellation)
try:
    for n in range({times}):
        Driver()
    print("continues", flush=True)
    while True:
        time.sleep(60)
except KeyboardInterrupt:
    signal.signal(signal.{name}, signal.SIG_IGN)  # one more may be on its way
    print("stopped", cancellation.exit_code)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="os.kill ends the process there")
@pytest.mark.parametrize(("name", "times", "code"), [("SIGINT", 1, 130), ("SIGTERM", 1, 143), ("SIGINT", 12, 130)])
def test_a_signal_that_an_object_s_end_swallows_is_heard_again(name: str, times: int, code: int) -> None:
    """Also where the one that is sent again comes while the next is being swallowed."""
    program = PROGRAM.format(name=name, times=times)
    ran = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=PATIENCE_S, env=environment(),
        check=False,
    )  # fmt: skip
    assert (ran.returncode, ran.stdout.split()[-2:], ran.stderr) == (0, ["stopped", str(code)], "")


#: what is swallowed cannot be heard, for the reason in *trouble*; the next signal falls into no such place
TROUBLED = """
import os, signal, sys, threading, time
from dvtcli.cli.signals import catch_signals
from dvtcli.device.cancellation import Cancellation

def cannot_show(lost):
    os.kill(os.getpid(), signal.SIGINT)
    raise OSError("stderr is gone")

class Driver:
    def __del__(self):
        {trouble}

{before}
cancellation = Cancellation()
catch_signals(cancellation)
try:
    Driver()
    {behind}
    time.sleep(5)
    print("not obeyed")
except KeyboardInterrupt:
    print("stopped", cancellation.exit_code)
"""
INTERRUPT = "os.kill(os.getpid(), signal.SIGINT)"


@pytest.mark.skipif(sys.platform == "win32", reason="os.kill ends the process there")
@pytest.mark.parametrize(
    ("before", "trouble", "behind", "said"),
    [
        pytest.param("threading.stack_size(1 << 46)", INTERRUPT, INTERRUPT, "once more", id="no thread can start"),
        pytest.param("sys.unraisablehook = cannot_show", "raise ValueError", "pass", "is gone", id="not shown"),
    ],
)
def test_a_signal_is_obeyed_after_one_that_could_not_be_heard(
    before: str, trouble: str, behind: str, said: str
) -> None:
    """What goes wrong while a swallowed exception is looked at leaves no program that nothing stops any more."""
    program = TROUBLED.format(before=before, trouble=trouble, behind=behind)
    ran = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=PATIENCE_S, env=environment(),
        check=False,
    )  # fmt: skip
    assert (ran.returncode, ran.stdout) == (0, "stopped 130\n")
    assert said in ran.stderr

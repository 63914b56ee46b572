"""A process with limits: a signal is obeyed while its output is waited for, whenever the signal came."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="a pipe cannot be waited for on Windows")

#: The handler's flag is set without a break in what the main thread waits for, as by a signal just before that wait.
_PROGRAM = """
import signal, sys, threading
from dvtcli.files.bounded_process import BoundedProcess

signal.signal(signal.SIGTERM, signal.default_int_handler)
signal.signal(signal.SIGINT, signal.default_int_handler)
child = "import time; print('begun', flush=True); time.sleep(600)"
with BoundedProcess([sys.executable, '-c', child], "the test") as process:
    assert process.stdout.readline() == b"begun" + bytes([10])
    elsewhere = threading.Timer(0.3, lambda: signal.pthread_kill(threading.get_ident(), signal.{name}))
    elsewhere.start()
    try:
        with process.within(60.0):
            process.stdout.{reads}
    except KeyboardInterrupt:
        print("too late" if process.is_late else "obeyed")
"""


@pytest.mark.parametrize("reads", ["readline(100)", "read(100)", "read()"])
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_is_obeyed_which_did_not_interrupt_the_read(name: str, reads: str) -> None:
    program = _PROGRAM.replace("{name}", name).replace("{reads}", reads)
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (ended.stdout, ended.returncode) == ("obeyed\n", 0), ended.stderr

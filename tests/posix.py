"""What only POSIX has, for tests that must be read elsewhere, too: signals by name, and why a test is skipped there."""

from __future__ import annotations

import os
import signal
import sys

import pytest

#: numbers where this system has no such signal: the tests that send them are skipped
SIGHUP: int = getattr(signal, "SIGHUP", 1)
SIGKILL: int = getattr(signal, "SIGKILL", 9)
SIGALRM: int = getattr(signal, "SIGALRM", 14)

needs_signals = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
needs_sessions = pytest.mark.skipif(not hasattr(os, "getsid"), reason="sessions of POSIX")
needs_own_python = pytest.mark.skipif("TESTS_ELSEWHERE" in os.environ, reason="the double is imported, too")
#: what stops a dvtcli: Ctrl-C; and what only POSIX lets a process handle
STOPPING = [
    signal.SIGINT,
    *(pytest.param(number, marks=needs_signals, id=str(int(number))) for number in (signal.SIGTERM, SIGHUP)),
]
needs_any_names = pytest.mark.skipif(sys.platform == "win32", reason="no control characters in names of files")
needs_shell = pytest.mark.skipif(sys.platform == "win32", reason="programs of a POSIX shell; there it is cmd")
needs_typing = pytest.mark.skipif(sys.platform == "win32", reason="what was typed waits in a console")
NO_TERMINAL = "no pseudo-terminal of POSIX"

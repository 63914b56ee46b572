"""What only POSIX has, for tests that must be read elsewhere, too: signals by name, and why a test is skipped there."""

from __future__ import annotations

import signal
import sys

import pytest

#: numbers where this system has no such signal: the tests that send them are skipped
SIGHUP: int = getattr(signal, "SIGHUP", 1)
SIGKILL: int = getattr(signal, "SIGKILL", 9)
SIGALRM: int = getattr(signal, "SIGALRM", 14)

needs_signals = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
NO_TERMINAL = "no pseudo-terminal of POSIX"

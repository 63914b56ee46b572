"""A process of ours ends by its own limits, whatever it does: in it they are set, and the system keeps them."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limits")

_LONGER = """
from time import process_time
from dvtcli.files.bounded_child import go_on, limit
limit(1 << 33)
for _ in range({times}):
    go_on(1)
    begun_s = process_time()
    while process_time() < begun_s + {seconds}:
        pass
print("at the end")
"""


@pytest.mark.drawn(1)
@pytest.mark.parametrize(("times", "seconds", "ends"), [(1, 60, False), (22, 0.1, True)])
def test_who_goes_on_may_take_longer_than_who_does_not(times: int, seconds: float, ends: bool) -> None:
    """The limit counts from the last step on: a file that is long is read to its end, one that hangs is not."""
    program = _LONGER.format(times=times, seconds=seconds)
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, encoding="ascii", check=False)
    assert ran.returncode == (0 if ends else -signal.SIGXCPU), ran.stderr
    assert bool(ran.stdout) == ends

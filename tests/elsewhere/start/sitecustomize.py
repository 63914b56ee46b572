"""Read by every Python that has this folder on its path: be the system that the variable says, before anything else."""

import os
import traceback

try:
    from tests.elsewhere import macos, windows

    {"windows": windows.become, "macos": macos.become}[os.environ["TESTS_ELSEWHERE"]]()
except BaseException:  # noqa: BLE001 - whatever it is
    traceback.print_exc()
    os._exit(99)  # Python would continue as what it is

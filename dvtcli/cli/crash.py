"""What is kept of a bug in dvtcli: its traceback, in a file that the user alone can read.

Does not know how an error is shown.
"""

from __future__ import annotations

import os
import tempfile
import traceback
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from dvtcli.device.trust import private_folder
from dvtcli.errors import SafetyRefusal
from dvtcli.files.user_folders import user_folder


def keep(bug: BaseException, frames: Sequence[str] = ()) -> str:
    """Write the traceback of *bug* into `crash/` of the state folder, else the system's folder; the file's path.

    Behind it stand *frames*, the last that were exchanged.
    """
    state = user_folder("state")
    try:
        private_folder(state)
        private_folder(state / "crash")
        return _written(bug, frames, state / "crash")
    except (OSError, SafetyRefusal):  # a state folder that cannot be used must not hide what went wrong
        return _written(bug, frames, None)


def _written(bug: BaseException, frames: Sequence[str], folder: Path | None) -> str:
    """Write into a new file of *folder*, which nothing can stand in the way of: its name is nobody's to foresee."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    descriptor, path = tempfile.mkstemp(prefix=f"dvtcli-crash-{stamp}-", suffix=".txt", dir=folder)  # 0600
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        traceback.print_exception(bug, file=file)
        file.writelines(f"{line}\n" for line in (["", "The last exchange:", *frames] if frames else []))
    return path

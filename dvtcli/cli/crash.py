"""Keep the traceback of a bug in dvtcli in a file readable by the user alone."""

from __future__ import annotations

import os
import tempfile
import traceback
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from dvtcli.device.change.private_file import private_folder
from dvtcli.errors import SafetyRefusal
from dvtcli.files.user_folders import user_folder


def keep(bug: BaseException, frames: Sequence[str] = ()) -> str:
    """Write the traceback of *bug* to `crash/` of the state folder, else the system's; returns the path.

    *frames*, the last frames exchanged, follow the traceback.
    """
    state = user_folder("state")
    try:
        private_folder(state)
        private_folder(state / "crash")
        return _written(bug, frames, state / "crash")
    except (OSError, SafetyRefusal):  # a state folder that cannot be used must not hide what went wrong
        return _written(bug, frames, None)


def _written(bug: BaseException, frames: Sequence[str], folder: Path | None) -> str:
    """Write to a new file of *folder* with an unpredictable name, against planted files."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    descriptor, path = tempfile.mkstemp(prefix=f"dvtcli-crash-{stamp}-", suffix=".txt", dir=folder)  # 0600
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        traceback.print_exception(bug, file=file)
        file.writelines(f"{line}\n" for line in (["", "The last exchange:", *frames] if frames else []))
    return path

"""Where the user's own files are: settings, what is kept of devices, state; and whether a file is still the same one.

Makes no folder, and opens no file.

platformdirs decides. Where its answer is plain, on Linux with absolute paths, it is not imported for it: that costs
each command as much as all that `--help` reads.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Literal

Kind = Literal["config", "data", "state"]
#: On Linux the variable of each kind, and the folder below the user's home where it is not set (XDG).
_XDG: dict[Kind, tuple[str, str]] = {
    "config": ("XDG_CONFIG_HOME", ".config"),
    "data": ("XDG_DATA_HOME", ".local/share"),
    "state": ("XDG_STATE_HOME", ".local/state"),
}


def user_folder(kind: Kind) -> Path:
    """Where the user's files of that *kind* are kept, whether the folder exists or not."""
    plain = _plain(kind)
    if plain is not None:
        return Path(plain, "dvtcli")
    import platformdirs

    return Path(getattr(platformdirs, f"user_{kind}_dir")("dvtcli"))


def file_state(path: Path) -> tuple[int, ...]:
    """What differs once the file at *path* was written or replaced, whatever time and size the new one was given."""
    now = path.stat()
    return now.st_ino, now.st_ctime_ns, now.st_mtime_ns, now.st_size


def _plain(kind: Kind) -> str | None:
    """The folder around it, where no more than XDG's variable and HOME count; None elsewhere."""
    if sys.platform != "linux" or "ANDROID_DATA" in os.environ or "platformdirs" in sys.modules:
        return None
    variable, below_home = _XDG[kind]
    home = os.environ.get("HOME", "")
    said = os.environ.get(variable, f"{home.rstrip('/')}/{below_home}" if home.startswith("/") else "")
    return said if said.startswith("/") else None

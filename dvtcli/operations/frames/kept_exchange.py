"""The exchange of a run that failed, kept in one file of the state folder, so that a run of its own can show it.

Written where a node refused or was silent, never else; the newest one alone, for its user alone, without passcodes.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from dvtcli.device.trust import open_private, private_folder, unreadable
from dvtcli.domain.ports import Frame
from dvtcli.domain.typed_frame import typed_frame
from dvtcli.errors import SafetyRefusal
from dvtcli.files.user_folders import user_folder

#: the value of a frame that was a passcode
LEFT_OUT = " (value not kept)"
_ARROWS = {"->": True, "<-": False}
#: 1024 frames, each a short line
_LONGEST = 256 * 1024


def keep_exchange(lines: Sequence[str]) -> bool:
    """Keep *lines* in place of those kept before; whether they are. Where there is no room the failure is the news."""
    if not lines:
        return False
    try:
        private_folder(_file().parent)
        descriptor, path = tempfile.mkstemp(prefix="last-exchange-", dir=_file().parent)  # 0600
        try:
            with os.fdopen(descriptor, "w", encoding="ascii") as file:
                file.writelines(f"{line}\n" for line in lines)
            Path(path).replace(_file())
        except BaseException:
            Path(path).unlink(missing_ok=True)
            raise
    except (OSError, SafetyRefusal):
        return False
    return True


def kept_exchange() -> list[tuple[Frame, bool, bool]]:
    """Each frame kept, whether it was ours, and whether its value was left out; none where nothing is, or damaged.

    SafetyRefusal or OSError where what is kept cannot be read.
    """
    if (unread := unreadable(_file().parent)) is not None:
        raise unread
    with suppress(FileNotFoundError, ValueError):
        descriptor = open_private(_file(), os.O_RDONLY)
        with os.fdopen(descriptor, encoding="ascii") as file:
            return [_frame(line) for line in file.read(_LONGEST).splitlines()]
    return []


def _file() -> Path:
    return user_folder("state") / "last-exchange.txt"


def _frame(line: str) -> tuple[Frame, bool, bool]:
    """The frame of a line as `exchange_text` writes it; ValueError where it is another one."""
    time, arrow, said = line.split(" ", 2)
    if arrow not in _ARROWS:
        raise ValueError(f"{arrow!r} is no arrow")
    frame = typed_frame(said.removesuffix(LEFT_OUT))
    at_s = datetime.fromisoformat(time.replace("Z", "+00:00")).timestamp()
    return replace(frame, timestamp_s=at_s), _ARROWS[arrow], said.endswith(LEFT_OUT)

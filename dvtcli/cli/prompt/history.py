"""The lines that were typed, kept between sessions in the user's state folder and readable by the user alone."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from prompt_toolkit.history import FileHistory, History, InMemoryHistory

from dvtcli.cli.view.output import Output
from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.trust import open_private, private_folder
from dvtcli.errors import SafetyRefusal
from dvtcli.files.user_folders import user_folder


class KeptHistory(FileHistory):
    """A history file; where the disk refuses a line, the session goes on with what is in memory."""

    def __init__(self, filename: str, is_secret: Callable[[str], bool]) -> None:
        super().__init__(filename)
        self._is_secret = is_secret

    def append_string(self, string: str) -> None:
        """Remember *string*, unless it may hold what is nobody's business."""
        if not self._is_secret(string):
            super().append_string(string)

    def store_string(self, string: str) -> None:
        """Append *string* to the file, if that is possible."""
        try:
            super().store_string(string)
        except OSError:
            return  # a full disk must not take the prompt away


def open_history(output: Output, is_secret: Callable[[str], bool]) -> History:
    """The history file, made where there is none; memory only, with a note, where it cannot be.

    Lines that *is_secret* says may hold a passcode are not kept.
    """
    path = user_folder("state") / "history"
    try:
        _prepare(path)
    except OSError as failed:
        output.note(f"this session's lines are not kept: {path}: {failed.strerror or failed}")
        return InMemoryHistory()
    except SafetyRefusal as refused:
        output.warning(f"this session's lines are not kept: {refused.text}; {typed(refused.hint)}")
        return InMemoryHistory()
    return KeptHistory(str(path), is_secret)


def _prepare(path: Path) -> None:
    """Make the file and its folder with the user's rights only; SafetyRefusal where they are others' as well."""
    private_folder(path.parent)
    os.close(open_private(path, os.O_RDWR | os.O_CREAT | os.O_APPEND))

"""Read lines of a text file of values."""

from __future__ import annotations

from collections.abc import Iterator
from io import TextIOWrapper
from pathlib import Path

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.input_file import open_input


def opened_text(path: Path) -> Iterator[str]:
    """Iterate over lines of *path*. Raises UsageError if absent, InputFileError if not UTF-8."""
    try:
        with TextIOWrapper(open_input(path), encoding="utf-8-sig", newline="") as file:
            yield from file
    except OSError as failed:
        raise UsageError(
            f"{path}: {failed.strerror or failed}", hint=Hint(Action.LOG_VALUES, {"file": path}, "records one")
        ) from failed
    except UnicodeDecodeError as wrong:
        raise InputFileError(f"{path.name} is no UTF-8 text", place=str(path)) from wrong
